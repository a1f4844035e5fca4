"""A replay buffer on disk, beside the checkpoint that needs it.

A buffer of a million transitions has half a gigabyte, of which little is new since the last
checkpoint. So new transitions are written to files of their own, and the checkpoint names those
that make up the buffer, each with its digest. Files that the buffer no longer needs are deleted
once the checkpoint stands: a process killed at any moment leaves all files of the last checkpoint,
and perhaps one that the next checkpoint replaces or deletes. The disk never holds more than the
buffer and the transitions since the previous checkpoint.

A *row* is one step of all robots; rows are counted from the beginning of the training.
"""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.numpy
from stable_baselines3.common.buffers import ReplayBuffer

from fbid_gym.bundles import Tensors, read_tensors, write_file
from fbid_gym.errors import RunError
from fbid_gym.reading import MOST_DATA, read_file

_FIELDS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
_FILE_BYTES = 2**26

File = dict[str, Any]
"""A checkpoint's entry for a file: rows "first" to "last", without the last; "sha256"."""


def append(folder: Path, buffer: ReplayBuffer, rows: int, files: Sequence[File]) -> list[File]:
    """Write the rows that no file holds yet.

    Args:
        folder: of the files; created if missing.
        buffer: holds the latest of the rows.
        rows: that have been added to it since the training began.
        files: as the last call has returned them; empty at first.

    Returns:
        The files that make up the buffer now, for the checkpoint.
    """
    capacity = buffer.buffer_size
    oldest = max(rows - capacity, 0)
    found = [dict(file) for file in files if file["last"] > oldest]
    first = max(found[-1]["last"] if found else 0, oldest)
    row_bytes = sum(getattr(buffer, name)[0].nbytes for name in _FIELDS)
    most = max(_FILE_BYTES // row_bytes, 1)
    folder.mkdir(parents=True, exist_ok=True)
    for start in range(first, rows, most):
        end = min(start + most, rows)
        places = np.arange(start, end) % capacity
        packed = safetensors.numpy.save({name: getattr(buffer, name)[places] for name in _FIELDS})
        write_file(folder / _name(start, end), packed)
        digest = hashlib.sha256(packed).hexdigest()
        found.append({"first": start, "last": end, "sha256": digest})
    return found


def forget(folder: Path, files: Sequence[File]) -> None:
    """Delete all other files, once a checkpoint names those of the buffer."""
    kept = {_name(file["first"], file["last"]) for file in files}
    for path in folder.iterdir():
        if path.name not in kept:
            path.unlink()


def restore(folder: Path, buffer: ReplayBuffer, rows: int, files: Sequence[File]) -> None:
    """Fill an empty buffer of the same size; rows and files are those that the checkpoint names.

    Raises:
        RunError: a file is missing, damaged or of another buffer, or the files do not hold the
            rows.
    """
    capacity = buffer.buffer_size
    oldest = max(rows - capacity, 0)
    _check_rows(folder, files, oldest, rows)
    for file in files:
        path = folder / _name(file["first"], file["last"])
        tensors = _read(path, file, buffer)
        held = np.arange(max(file["first"], oldest), file["last"])
        for name, values in tensors.items():
            getattr(buffer, name)[held % capacity] = values[held - file["first"]]
    buffer.pos, buffer.full = rows % capacity, rows >= capacity


def _name(first: int, last: int) -> str:
    return f"{first:012d}-{last:012d}.safetensors"


def _check_rows(folder: Path, files: Any, oldest: int, rows: int) -> None:
    """Raise RunError unless the files follow each other, up to the last row."""
    try:
        bounds = [(file["first"], file["last"]) for file in files]
        numbers = [value for pair in bounds for value in pair]
    except (KeyError, TypeError) as reason:
        raise RunError(f"{folder}: the checkpoint does not say which files ({reason}).") from reason
    whole = all(type(value) is int and value >= 0 for value in numbers)
    joined = whole and all(a < b for a, b in bounds) and numbers[1:-1:2] == numbers[2::2]
    if rows and not (joined and numbers and numbers[0] <= oldest and numbers[-1] == rows):
        raise RunError(
            f"{folder}: the checkpoint names rows {numbers[:1]} to {numbers[-1:]} of the replay "
            f"buffer. Expected {oldest} to {rows}."
        )


def _read(path: Path, file: File, buffer: ReplayBuffer) -> Tensors:
    packed = read_file(path, MOST_DATA, RunError)
    if hashlib.sha256(packed).hexdigest() != file.get("sha256"):
        raise RunError(f"{path}: corrupt, or not the file that the checkpoint was saved with.")
    tensors = read_tensors(packed, path, RunError)
    for name in _FIELDS:
        own = getattr(buffer, name)
        expected = (file["last"] - file["first"], *own.shape[1:])
        found = tensors.get(name)
        if found is None or found.shape != expected or found.dtype != own.dtype:
            have = "missing" if found is None else f"{found.dtype} {found.shape}"
            raise RunError(f"{path}: {name} is {have}. Expected {own.dtype} {expected}.")
    return {name: tensors[name] for name in _FIELDS}
