"""JSON files that are either whole or absent."""

import json
import math
from pathlib import Path
from typing import Any

from fbid_gym.bundles import write_file
from fbid_gym.errors import RunError
from fbid_gym.reading import read_object


def write(path: Path, content: str | bytes) -> None:
    """Write the whole file or nothing. Creates missing parent folders."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, content.encode() if isinstance(content, str) else content)


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
