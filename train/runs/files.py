"""Files that are either whole or absent, and where they can be: checked before the work."""

import json
import math
import tempfile
from pathlib import Path
from typing import Any

from fbid_gym.bundles import write_file
from fbid_gym.errors import InvalidValueError, RunError
from fbid_gym.reading import read_object


def write(path: Path, content: str | bytes) -> None:
    """Write the whole file or nothing. Creates missing parent folders."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, content.encode() if isinstance(content, str) else content)


def check_folder(folder: Path, name: str, given: str | None = None) -> None:
    """Refuse a folder that cannot be made or written, before any work is done for it.

    Args:
        folder: that will hold the file.
        name: of the option.
        given: the user's path. Default: the folder.

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


def check_output(path: Path | None, name: str, suffixes: tuple[str, ...]) -> None:
    """Refuse an output path, if there is one, before any work is done for it.

    Raises:
        InvalidValueError: the suffix is not among `suffixes`, the path is a folder, or nothing can
            be written there.
    """
    if path is None:
        return
    if path.suffix.lower() not in suffixes:
        raise InvalidValueError(name, str(path), f"a file name ending in {' or '.join(suffixes)}")
    if path.is_dir():
        raise InvalidValueError(name, str(path), "a file name; this is a folder")
    check_folder(path.parent, name, str(path))


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        RunError: the file cannot be read, or holds anything else.
    """
    return read_object(path, RunError)


def to_json(value: Any) -> str:
    """JSON text of nested dicts and lists; NaN and infinity become null, which JSON can hold."""
    return json.dumps(_finite(value), indent=1) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if hasattr(value, "tolist"):
        return _finite(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
