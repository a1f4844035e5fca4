"""Paths of the project's own files, in a checkout and in an installed package."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def asset_places(name: str) -> tuple[Path, ...]:
    """Return where a file or folder of `assets/` can be, there or not.

    A built wheel carries the folder inside the package; a checkout has it beside the package.
    """
    return _PACKAGE / "assets" / name, _PACKAGE.parent / "assets" / name
