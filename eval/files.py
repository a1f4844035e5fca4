"""Files that are either whole or absent."""

import json
import math
from pathlib import Path
from typing import Any

from fbid_gym.bundles import write_file
from fbid_gym.errors import InvalidValueError, RunError


def check_output(path: Path, name: str, suffixes: tuple[str, ...]) -> None:
    """Refuse an output path before any work is done for it.

    Raises:
        InvalidValueError: the suffix is not among `suffixes`, or the path is a folder.
    """
    if path.suffix.lower() not in suffixes:
        raise InvalidValueError(name, str(path), f"a file name ending in {' or '.join(suffixes)}")
    if path.is_dir():
        raise InvalidValueError(name, str(path), "a file name; this is a folder")


def write(path: Path, content: str | bytes) -> None:
    """Write the whole file or nothing. Creates missing parent folders."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, content.encode() if isinstance(content, str) else content)


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        RunError: the file holds anything else.
    """
    try:
        value = json.loads(path.read_text())
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise RunError(f"{path}: not readable as JSON ({error}).") from error
    if not isinstance(value, dict):
        raise RunError(f"{path}: expected a JSON object.")
    return value


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
