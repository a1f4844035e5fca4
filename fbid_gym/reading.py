"""Files that may come from strangers: read within bounds, or refused in one sentence."""

import json
import math
import os
import stat
from pathlib import Path
from typing import Any, NoReturn

from fbid_gym.errors import FbidError

MOST_JSON = 2**24
"""Bytes of a JSON file."""

MOST_DATA = 2**30
"""Bytes of a file of arrays or of a table."""


def read_file(path: Path, most: int, error: type[FbidError]) -> bytes:
    """Return what is in a regular file.

    Args:
        path: the file; a pipe or a device, which may never end, is refused.
        most: bytes.
        error: the error to raise.

    Raises:
        FbidError: as the type `error`, naming the file.
    """
    try:
        # Not waiting for somebody to write into a pipe.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with open(descriptor, "rb") as file:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode):
                raise error(f"{path}: cannot be read (no regular file).")
            content = b"" if status.st_size > most else file.read(most + 1)
    except (OSError, ValueError) as reason:
        words = reason.strerror if isinstance(reason, OSError) else str(reason)
        raise error(f"{path}: cannot be read ({words}).") from reason
    if len(content) > most or status.st_size > most:
        raise error(f"{path}: has more than {most >> 20} MB, the most that is read.")
    return content


def read_object(path: Path, error: type[FbidError]) -> dict[str, Any]:
    """Return the JSON object in a file.

    Args:
        path: the file.
        error: the error to raise.

    Raises:
        FbidError: as the type `error`, naming the file: it cannot be read, is too large, truncated
            or corrupt, or holds anything else, such as NaN.
    """
    return parse_object(read_file(path, MOST_JSON, error), path, error)


def parse_object(text: str | bytes, path: Path, error: type[FbidError]) -> dict[str, Any]:
    """Return the JSON object in what a file holds, or raise `error` as `read_object` does."""
    try:
        value = json.loads(text, parse_constant=_no_number, parse_float=_finite)
    except (ValueError, RecursionError) as reason:
        raise error(f"{path}: not JSON, truncated or corrupt ({reason}).") from reason
    if not isinstance(value, dict):
        raise error(f"{path}: holds {type(value).__name__}. Expected a JSON object.")
    return value


def _finite(word: str) -> float:
    return float(word) if math.isfinite(float(word)) else _no_number(word)


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"{word} is no number")
