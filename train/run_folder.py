"""The folder of a run: one run per folder, one process per run."""

import fcntl
import json
import os
import platform
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fbid_gym.bundles import present_bundle, write_file
from fbid_gym.envs.config import resolved_arguments
from fbid_gym.errors import RunError
from train.config import TrainConfig, differences, flat
from train.versions import package_versions, versions

_CONFIG, _VERSIONS, _LOCK = "config.json", "versions.json", ".lock"
_ENVIRONMENT = "environment.json"
_WRITTEN = {
    _VERSIONS, _ENVIRONMENT, "progress.csv", "evaluations.csv", "tensorboard",
    *(f"{name}{end}" for name in ("checkpoint", "policy", "policy_best")
      for end in ("", ".new", ".old")),
    f"{_CONFIG}.new", f"{_VERSIONS}.new", f"{_ENVIRONMENT}.new",
}  # fmt: skip


@dataclass(frozen=True)
class RunFolder:
    """Where a run keeps what it writes."""

    path: Path
    """The folder."""
    resumes: bool
    """There is a checkpoint to continue from."""
    changes: tuple[str, ...] = ()
    """Versions and meanings of the environment's arguments that are not those the run began with,
    so that it may round differently or learn something else."""

    @property
    def progress(self) -> Path:
        """One row per iteration."""
        return self.path / "progress.csv"

    @property
    def evaluations(self) -> Path:
        """One row per evaluation."""
        return self.path / "evaluations.csv"

    @property
    def checkpoint(self) -> Path:
        """The latest exact state."""
        return self.path / "checkpoint"

    @property
    def policy(self) -> Path:
        """The policy at the latest evaluation, at the end of training the final one."""
        return self.path / "policy"

    @property
    def best_policy(self) -> Path:
        """The policy of the evaluation with the highest mean return."""
        return self.path / "policy_best"

    @property
    def tensorboard(self) -> Path:
        """TensorBoard events."""
        return self.path / "tensorboard"


@contextmanager
def open_run(config: TrainConfig) -> Iterator[RunFolder]:
    """Open the run folder of a configuration, alone, until the context ends.

    A folder that holds this run is continued; what it holds of this run without a checkpoint is
    removed and the run starts anew. Files that a run does not write are never touched.

    Raises:
        RunError: the folder holds another run (names what differs), or no run but other files, or
            is in use by another process.
    """
    path = config.folder
    asked = config.to_json()
    meaning = resolved_arguments(config.env, config.make_args())
    stored = _stored_config(path)
    if stored is not None and not config.overwrite:
        different = differences(stored, asked)
        if different:
            raise RunError(
                f"{path}: holds another run: {'; '.join(different)}. Choose another --out, or "
                "--overwrite to start anew."
            )
    path.mkdir(parents=True, exist_ok=True)
    with _locked(path):
        checkpoint = path / "checkpoint"
        resumes = (
            stored is not None and not config.overwrite and present_bundle(checkpoint).exists()
        )
        if not resumes:
            for name in _WRITTEN:
                _remove(path / name)
            _write_json(path / _VERSIONS, versions())
            if meaning is not None:
                _write_json(path / _ENVIRONMENT, meaning)
        if stored != asked:
            _write_json(path / _CONFIG, asked)
        changes: tuple[str, ...] = ()
        if resumes:
            now = {"python": platform.python_version(), **package_versions()}
            changes = _changes(path / _VERSIONS, _flat_versions, now)
            # Absent in runs that began before it was written.
            if meaning is not None and (path / _ENVIRONMENT).exists():
                changes += _changes(path / _ENVIRONMENT, flat, flat(meaning))
        yield RunFolder(path, resumes, changes)


def _stored_config(path: Path) -> dict[str, Any] | None:
    """Read the configuration a folder was made with; None where there is no run yet."""
    if not path.exists():
        return None
    if not path.is_dir():
        raise RunError(f"{path}: is a file. Expected a run folder or a new one.")
    file = path / _CONFIG
    if not file.exists():
        foreign = sorted(entry.name for entry in path.iterdir()
                         if entry.name not in _WRITTEN | {_LOCK})  # fmt: skip
        if foreign:
            raise RunError(
                f"{path}: holds {', '.join(foreign[:3])} but no {_CONFIG}, so it is not a run "
                "folder. Expected a run folder, an empty one or a new one."
            )
        return None
    try:
        stored = json.loads(file.read_text())
    except ValueError as reason:
        raise RunError(f"{file}: not JSON, truncated or corrupt ({reason}).") from reason
    if not isinstance(stored, dict):
        raise RunError(f"{file}: holds {type(stored).__name__}. Expected a JSON object.")
    return stored


def _changes(
    file: Path, read: Callable[[dict[str, Any]], dict[str, Any]], now: dict[str, Any]
) -> tuple[str, ...]:
    """Name what is not as the file says it was."""
    try:
        then = read(json.loads(file.read_text()))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return (f"{file.name} cannot be read",)
    return tuple(
        f"{name} {then.get(name, 'absent')} when it began, {now.get(name, 'absent')} now"
        for name in sorted(then.keys() | now.keys())
        if then.get(name) != now.get(name)
    )


def _flat_versions(stored: dict[str, Any]) -> dict[str, Any]:
    return {"python": stored["python"], **stored["packages"]}


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold the folder; the lock ends with the process, however that ends."""
    with (path / _LOCK).open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as reason:
            file.seek(0)
            raise RunError(
                f"{path}: is being trained by process {file.read().strip() or 'unknown'}. Wait "
                "for it, or choose another --out."
            ) from reason
        file.truncate(0)
        file.write(str(os.getpid()))
        file.flush()
        yield


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _write_json(path: Path, data: dict[str, Any]) -> None:
    write_file(path, (json.dumps(data, indent=2) + "\n").encode())
