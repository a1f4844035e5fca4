"""Files that commands write: checked before the work, whole or absent afterwards."""

import os
from pathlib import Path

from fbid_gym.errors import InvalidValueError
from train.runs.files import read_json, to_json, write

__all__ = ["check_output", "read_json", "to_json", "write"]


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
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise InvalidValueError(
            name, str(path), f"a file that can be written; {folder} is in the way"
        )
