"""Where the project's own files lie, in a checkout and in an installed package."""

from pathlib import Path

from fbid_gym.errors import RobotError

_PACKAGE = Path(__file__).resolve().parents[1]


def asset_path(name: str) -> Path:
    """Path of a file in `assets/`.

    A built wheel carries the folder inside the package; a checkout has it beside the package.

    Raises:
        RobotError: neither place has the file.
    """
    places = [_PACKAGE / "assets" / name, _PACKAGE.parent / "assets" / name]
    for path in places:
        if path.is_file():
            return path
    raise RobotError(f"Asset {name!r} not found. Looked at: {', '.join(map(str, places))}.")
