"""One safetensors file with JSON in its metadata: an exported policy, or a training's checkpoint.

A SHA-256 covers the JSON and the arrays. Reading needs neither pickle nor torch, so a file from a
stranger can at worst be refused. A file is replaced as a whole: a process killed at any moment
leaves the one before or the new one.
"""

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import safetensors
import safetensors.numpy

from fbid_gym.errors import FbidError, InvalidValueError
from fbid_gym.reading import MOST_DATA, MOST_JSON, parse_object, read_file

SUFFIX = ".safetensors"
Tensors = dict[str, np.ndarray]

_JSON = "fbid_gym"  # alone in the metadata: safetensors writes several keys in any order
_DIGEST = "sha256"


class Bundle(NamedTuple):
    """Contents of a file."""

    data: dict[str, Any]
    """Its JSON."""
    tensors: Tensors
    """Its arrays."""


def save_bundle(file: Path, data: Mapping[str, Any], tensors: Mapping[str, np.ndarray]) -> None:
    """Write a file, replacing an earlier one; missing folders are made.

    Args:
        file: its place.
        data: JSON values.
        tensors: arrays of booleans, integers or floats, by name.

    Raises:
        InvalidValueError: `file` is a folder, or a tensor or a value has a type that the file
            cannot hold, or there are more of them than `load_bundle` reads. Nothing is written
            then.
    """
    if file.is_dir():
        raise InvalidValueError("file", str(file), "a file, not a folder")
    for key, tensor in tensors.items():
        if tensor.dtype.kind not in "biuf":
            raise InvalidValueError(
                f"tensor {key!r}", str(tensor.dtype), "booleans, integers or floats"
            )
    # safetensors writes the raw buffer, so the array must be contiguous; copy() keeps 0-d shapes.
    arrays = {key: tensor.copy(order="C") for key, tensor in tensors.items()}
    try:
        # Keys of other types than str would be read back as such, with another digest.
        data = json.loads(json.dumps(dict(data), allow_nan=False))
    except (TypeError, ValueError) as error:
        raise InvalidValueError(file.name, data, f"values JSON can hold ({error})") from error
    text = json.dumps({**data, _DIGEST: _digest(data, arrays)})
    packed = safetensors.numpy.save(arrays, {_JSON: text})
    for name, size, most in (
        (f"JSON in {file.name}", len(_header(packed)), MOST_JSON),
        (file.name, len(packed), MOST_DATA),
    ):
        if size > most:
            raise InvalidValueError(f"size of {name}", size, f"at most {most:,} bytes")
    write_file(file, packed)


def load_bundle(file: Path, error: type[FbidError]) -> Bundle:
    """Read what `save_bundle` wrote.

    Args:
        file: its place.
        error: the error to raise.

    Raises:
        FbidError: as the type `error`, naming the file: missing, truncated or corrupt.
    """
    packed = read_file(file, MOST_DATA, error)
    tensors = read_tensors(packed, file, error)
    header = _header(packed)
    if len(header) > MOST_JSON:
        raise error(f"{file}: its JSON has more than {MOST_JSON >> 20} MB, the most that is read.")
    text = (parse_object(header, file, error).get("__metadata__") or {}).get(_JSON)
    if text is None:
        raise error(f"{file}: not of this package. Expected JSON as {_JSON!r} in its metadata.")
    data = parse_object(text, file, error)
    expected, found = data.pop(_DIGEST, None), _digest(data, tensors)
    if expected != found:
        raise error(f"{file}: corrupt: its SHA-256 is {found}. Expected {expected!r}.")
    return Bundle(data, tensors)


def read_tensors(packed: bytes, file: Path, error: type[FbidError]) -> Tensors:
    """Return the arrays of a safetensors file whose bytes are `packed`, or raise `error`."""
    try:
        return safetensors.numpy.load(packed)
    except (safetensors.SafetensorError, ValueError, KeyError, TypeError) as reason:
        raise error(f"{file}: not safetensors, truncated or corrupt ({reason}).") from reason


def _header(packed: bytes) -> bytes:
    """The JSON at the beginning of a file, of which safetensors keeps the metadata to itself."""
    return packed[8 : 8 + int.from_bytes(packed[:8], "little")]


def _digest(data: Mapping[str, Any], tensors: Tensors) -> str:
    digest = hashlib.sha256(json.dumps(data, sort_keys=True).encode())
    for name, tensor in sorted(tensors.items()):
        digest.update(f"\n{name} {tensor.dtype.name} {tensor.shape}\n".encode())
        digest.update(tensor.tobytes())
    return digest.hexdigest()


def write_file(path: Path, content: bytes) -> None:
    """Write a file beside its place, then rename it there, so that it is never half-written."""
    fresh = fresh_path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with fresh.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())  # a rename must not overtake what is in the file
    os.replace(fresh, path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # nor the deletion of what is replaced the rename
    finally:
        os.close(folder)


def fresh_path(path: Path) -> Path:
    """Return where what replaces a file is made; hidden, so that nobody's copy is in the way."""
    return path.with_name(f".{path.name}.new")
