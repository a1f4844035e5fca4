"""Files that commands write: checked before the work, whole or absent afterwards."""

import tempfile
from pathlib import Path

from fbid_gym.errors import InvalidValueError
from train.runs.files import read_json, to_json, write

__all__ = ["check_folder", "check_output", "read_json", "to_json", "write"]


def check_output(path: Path, name: str, suffixes: tuple[str, ...]) -> None:
    """Refuse an output path before any work is done for it.

    Raises:
        InvalidValueError: the suffix is not among `suffixes`, the path is a folder, or nothing can
            be written there.
    """
    if path.suffix.lower() not in suffixes:
        raise InvalidValueError(name, str(path), f"a file name ending in {' or '.join(suffixes)}")
    if path.is_dir():
        raise InvalidValueError(name, str(path), "a file name; this is a folder")
    check_folder(path.parent, name, str(path))


def check_folder(folder: Path, name: str, given: str | None = None) -> None:
    """Refuse a folder that cannot be made or written, before any work is done for it.

    Args:
        folder: that will hold what is written.
        name: of the option.
        given: what was said. Default: the folder.

    Raises:
        InvalidValueError: a part of its path is no folder, it is read-only, or the disk is full.
    """
    try:
        place = next(path for path in (folder, *folder.parents) if path.exists())
        with tempfile.TemporaryFile(dir=place) as probe:
            probe.write(bytes(4096))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        expected = f"a place where files can be written ({reason})"
        raise InvalidValueError(name, given or str(folder), expected) from error
