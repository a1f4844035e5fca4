"""A folder holding one JSON file and one safetensors file, replaced as a whole or not at all.

Exported policies and training checkpoints are both such bundles. Reading needs neither pickle nor
torch, so a file from a stranger can at worst be refused.

Replacing `folder` goes: fill `.folder.new`, rename `folder` to `.folder.old`, rename `.folder.new`
to `folder`, delete `.folder.old`. A process killed anywhere in between leaves at least one complete
bundle under `folder` or `.folder.old`, and `load_bundle` reads whichever is there. These names are
hidden, so that no copy that somebody keeps beside the folder is in the way.
"""

import hashlib
import json
import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.numpy

from fbid_gym.errors import FbidError, InvalidValueError
from fbid_gym.reading import MOST_DATA, MOST_JSON, read_file, read_object

Tensors = dict[str, np.ndarray]

_DIGEST = "sha256"


@dataclass(frozen=True, eq=False)
class Bundle:
    """What `load_bundle` read."""

    data_file: Path
    """The JSON file."""
    tensor_file: Path
    """The safetensors file."""
    data: dict[str, Any]
    """What the JSON file holds."""
    tensors: Tensors
    """What the safetensors file holds."""
    digest: str
    """SHA-256 of what both files hold."""

    def check_digest(self, error: type[FbidError]) -> None:
        """Raise `error` when the files are not those that were written, together.

        Not part of `load_bundle`, so that checks which can say more (a missing tensor, a wrong
        shape) come first.
        """
        expected = self.data.get(_DIGEST)
        if expected != self.digest:
            raise error(
                f"{self.tensor_file}: corrupt, or from another save than {self.data_file.name} "
                f"beside it: their SHA-256 is {self.digest}. Expected {expected!r}."
            )


def save_bundle(
    folder: Path, name: str, data: Mapping[str, Any], tensors: Mapping[str, np.ndarray]
) -> None:
    """Write `folder/name.json` and `folder/name.safetensors`, replacing an earlier bundle.

    Args:
        folder: where the bundle goes; created if missing.
        name: stem of both files.
        data: what JSON can hold. A digest of all that is in the bundle is added.
        tensors: arrays of booleans, integers or floats, by name.

    Raises:
        InvalidValueError: `folder` holds anything that is not an earlier bundle of this name, or
            a tensor or a value has a type that the files cannot hold, or there are more of them
            than `load_bundle` reads. Nothing is written then.
    """
    folder = Path(folder).resolve()
    fresh, previous = fresh_path(folder), previous_path(folder)
    for own in (folder, fresh, previous):
        _refuse_foreign(own, name)
    for key, tensor in tensors.items():
        if tensor.dtype.kind not in "biuf":
            raise InvalidValueError(
                f"tensor {key!r}", str(tensor.dtype), "booleans, integers or floats"
            )
    # safetensors writes the raw buffer, so the array must be contiguous; copy() keeps 0-d shapes.
    packed = safetensors.numpy.save({k: t.copy(order="C") for k, t in tensors.items()})
    try:
        # Keys of other types than str would be read back as such, with another digest.
        data = json.loads(json.dumps(dict(data), allow_nan=False))
    except (TypeError, ValueError) as error:
        raise InvalidValueError(f"{name}.json", data, f"values JSON can hold ({error})") from error

    text = json.dumps({**data, _DIGEST: _digest(data, packed)}, indent=2)
    for file, size, most in (
        ("json", len(text), MOST_JSON),
        ("safetensors", len(packed), MOST_DATA),
    ):
        if size > most:
            raise InvalidValueError(f"size of {name}.{file}", size, f"at most {most:,} bytes")
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    _write_through(fresh / f"{name}.safetensors", packed)
    _write_through(fresh / f"{name}.json", (text + "\n").encode())
    sync_folder(fresh)
    if folder.exists():
        shutil.rmtree(previous, ignore_errors=True)
        os.rename(folder, previous)
    os.rename(fresh, folder)
    sync_folder(folder.parent)
    shutil.rmtree(previous, ignore_errors=True)


def load_bundle(folder: Path, name: str, error: type[FbidError]) -> Bundle:
    """Read what `save_bundle` wrote to `folder`, or to `.folder.old` after an interrupted save.

    Args:
        folder: the folder given to `save_bundle`.
        name: stem of both files.
        error: the error to raise.

    Raises:
        FbidError: as the type `error`, naming the file: missing, truncated or corrupt.
    """
    folder = present_bundle(Path(folder))
    data_file, tensor_file = folder / f"{name}.json", folder / f"{name}.safetensors"
    data, packed = read_object(data_file, error), read_file(tensor_file, MOST_DATA, error)
    try:
        tensors = safetensors.numpy.load(packed)
    except (safetensors.SafetensorError, ValueError, KeyError, TypeError) as reason:
        raise error(f"{tensor_file}: not safetensors, truncated or corrupt ({reason}).") from reason
    return Bundle(data_file, tensor_file, data, tensors, _digest(data, packed))


def _digest(data: Mapping[str, Any], packed: bytes) -> str:
    """SHA-256 of a bundle, of its JSON however it is laid out."""
    plain = {name: value for name, value in data.items() if name != _DIGEST}
    text = json.dumps(plain, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(hashlib.sha256(packed).digest() + text.encode()).hexdigest()


def present_bundle(folder: Path) -> Path:
    """Return `folder`, or `.folder.old` where only that survived an interrupted save."""
    previous = previous_path(folder)
    return previous if previous.exists() and not folder.exists() else folder


def write_file(path: Path, content: bytes) -> None:
    """Write a file beside its place, then rename it there, so that it is never half-written."""
    fresh = fresh_path(path)
    _write_through(fresh, content)
    os.replace(fresh, path)


def sync_folder(folder: Path) -> None:
    """Wait until what was renamed in a folder is on the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _refuse_foreign(folder: Path, name: str) -> None:
    """Refuse to replace a folder somebody keeps other things in: replacing deletes it."""
    if not folder.exists():
        return
    if not folder.is_dir():
        raise InvalidValueError("folder", str(folder), "a folder, found a file")
    own = {f"{name}.json", f"{name}.safetensors"}
    foreign = sorted(entry.name for entry in folder.iterdir() if entry.name not in own)
    if foreign:
        raise InvalidValueError(
            "folder",
            str(folder),
            f"a new folder or one with nothing but {' and '.join(sorted(own))}, "
            f"found {', '.join(foreign[:3])}",
        )


def fresh_path(path: Path) -> Path:
    """Return where what replaces a file or folder is made."""
    return path.with_name(f".{path.name}.new")


def previous_path(path: Path) -> Path:
    """Return where what is replaced lies until it is deleted."""
    return path.with_name(f".{path.name}.old")


def _write_through(path: Path, content: bytes) -> None:
    """Write and wait until it is on the disk: a rename must not overtake its contents."""
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
