"""Finished runs in one file: `studies/walking.zip` holds the run folders of `studies/walking`.

A run folder that is not on the disk is read from such an archive, by every command. Its files are
copied to a folder of this process under the names that files of a run have, so that nothing an
archive says decides where something is written. `python -m train.pack` makes archives.
"""

import atexit
import io
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path, PurePosixPath

from fbid_gym.errors import RunError
from fbid_gym.reading import read_file

SUFFIX = ".zip"

KEPT = (
    *("config.json", "versions.json", "environment.json", "robot.zip"),
    *("progress.csv", "evaluations.csv", "policy.safetensors"),
    *("policy/policy.json", "policy/policy.safetensors"),  # of earlier versions of this package
)
"""What an archive may hold of a run: what it found, not what it needs to go on."""

MOST_BYTES = 2**27
"""Of an archive, and of a run in it."""

Files = dict[str, bytes]
"""Name of a file of `KEPT` -> what it holds."""

_WAYS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_BROKEN = (OSError, ValueError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)
"""What a damaged archive raises; ValueError: a name that is no UTF-8."""


def found(path: Path) -> Path:
    """Return where a run folder, or something in it, is read.

    Args:
        path: where it is not on the disk, `walking/RUN` is sought in `walking.zip`, and so is
            `walking.zip/RUN`.

    Returns:
        The path itself, or that of a copy of what an archive holds; the path, too, where neither
        is there.

    Raises:
        RunError: the archive cannot be read, or is too large.
    """
    archive = packed_in(path)
    if archive is None:
        return path
    run, *inside = _inside(path, archive)
    return _copy(archive.absolute(), _stamp(archive), run).joinpath(*inside)


def packed_in(path: Path) -> Path | None:
    """Return the archive that holds a path that is not on the disk; None where none does.

    Raises:
        RunError: an archive that might cannot be read, or is too large.
    """
    if path.exists():
        return None
    for folder in path.parents:
        beside = (
            folder.with_name(folder.name.removesuffix(SUFFIX) + SUFFIX) if folder.name else folder
        )
        if beside.is_file():
            run, *inside = _inside(path, beside)
            held = (PurePosixPath(file).parts for file in _entries(beside, run))
            if any(parts[: len(inside)] == tuple(inside) for parts in held):
                return beside
    return None


def _inside(path: Path, archive: Path) -> tuple[str, ...]:
    """The parts of a path below the folder that an archive is of."""
    return path.parts[len(archive.parts) :]


def read_archive(archive: Path) -> dict[str, Files]:
    """Return the files of all runs that an archive holds, by the name of the run.

    Raises:
        RunError: it cannot be read, or is too large.
    """
    names = map(PurePosixPath, _opened(archive).namelist())
    runs = sorted({name.parts[0] for name in names if name.parts[1:] == ("config.json",)})
    return {run: _files(archive, run) for run in runs}


def as_archive(runs: Mapping[str, Mapping[str, bytes]]) -> bytes:
    """Return runs as an archive that depends on what their files hold alone.

    Raises:
        RunError: it, or a run, is larger than what is read.
    """
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for run, files in sorted(runs.items()):
            for name, data in sorted(files.items()):
                entry = zipfile.ZipInfo(f"{run}/{name}")  # of 1980
                archive.writestr(entry, data, zipfile.ZIP_DEFLATED, compresslevel=9)
    largest = max(sum(map(len, files.values())) for files in runs.values())
    if max(len(content.getvalue()), largest) > MOST_BYTES:
        raise RunError(f"The archive, or a run in it, has more than {MOST_BYTES >> 20} MB.")
    return content.getvalue()


Stamp = tuple[int, int]
"""Time of a file and its number on the disk: another one where it was replaced."""


def _stamp(archive: Path) -> Stamp:
    status = archive.stat()
    return status.st_mtime_ns, status.st_ino


def _opened(archive: Path) -> zipfile.ZipFile:
    return _held(archive.absolute(), _stamp(archive))


@cache
def _held(archive: Path, stamp: Stamp) -> zipfile.ZipFile:
    """An archive as it was at a time, in memory."""
    try:
        return zipfile.ZipFile(io.BytesIO(read_file(archive, MOST_BYTES, RunError)))
    except _BROKEN as error:
        raise RunError(f"{archive}: is no archive of runs that can be read ({error}).") from error


def _entries(archive: Path, run: str) -> dict[str, zipfile.ZipInfo]:
    held = _opened(archive).NameToInfo
    return {name: held[f"{run}/{name}"] for name in KEPT if f"{run}/{name}" in held}


def _files(archive: Path, run: str) -> Files:
    opened, entries = _opened(archive), _entries(archive, run)
    if sum(entry.file_size for entry in entries.values()) > MOST_BYTES:
        raise RunError(f"{archive}: {run} unpacks to more than {MOST_BYTES >> 20} MB.")
    try:
        if any(entry.compress_type not in _WAYS for entry in entries.values()):
            raise ValueError("packed in another way than deflate")
        return {name: opened.read(entry) for name, entry in entries.items()}
    except _BROKEN as error:
        raise RunError(f"{archive}: {run} cannot be read ({error}).") from error


@cache
def _copy(archive: Path, stamp: Stamp, run: str) -> Path:
    """The folder of a run, written once in a process and removed as it ends."""
    place = Path(tempfile.mkdtemp(prefix="fbid-runs-"))
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    folder = place / archive.name / run
    for name, content in _files(archive, run).items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
    return folder
