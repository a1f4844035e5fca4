"""Files that commands write: checked before the work, whole or absent afterwards."""

from pathlib import Path

from fbid_gym.errors import InvalidValueError
from train.runs.files import check_folder, read_json, to_json, write

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
