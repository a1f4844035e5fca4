"""Opening a run folder for training: configuration and versions, one process per run."""

import fcntl
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fbid_gym.bundles import load_bundle
from fbid_gym.errors import RunError
from fbid_gym.robots import Robot
from train.runs.archive import packed_in
from train.runs.config import TrainConfig
from train.runs.differences import (
    Difference,
    differences,
    environment_differences,
    in_words,
    made_with,
    run_differences,
)
from train.runs.environment import meaning
from train.runs.files import read_json, to_json, write
from train.runs.folder import RunFolder
from train.runs.tables import last_steps
from train.runs.versions import versions


@dataclass(frozen=True)
class OpenRun:
    """A run folder in the hands of this process; nothing of the run is written before `begin`."""

    folder: RunFolder  # where it is
    config: dict[str, Any]  # the configuration
    # Meaning of its environment's arguments; None where that is not known.
    meaning: dict[str, Any] | None
    resumes: bool  # there is a checkpoint to continue from
    robot: Robot | None  # that it is of, where it is none of the built-in ones
    # Versions and meanings of the environment's arguments that are not those the run began with, so
    # that it may round differently or learn something else.
    changes: tuple[str, ...]

    def begin(self) -> None:
        """Write the run's configuration. Unless it resumes from a checkpoint, remove the rest."""
        folder = self.folder
        if not self.resumes:
            for path in folder.results:
                _remove(path)
            write(folder.versions, to_json(versions()))
            if self.meaning is not None:
                write(folder.environment, to_json(self.meaning))
        if self.robot is not None:
            self.robot.save(folder.robot)
        if not folder.config.exists() or read_json(folder.config) != self.config:
            write(folder.config, to_json(self.config))


def continued(config: TrainConfig) -> TrainConfig:
    """Return a configuration with the choices of the run that it continues, if there is one."""
    folder = RunFolder.of(config.folder)
    if config.torch_threads or config.overwrite or not folder.config.is_file():
        return config
    chosen = read_json(folder.config).get("torch_threads", 0)
    return replace(config, torch_threads=chosen)


@contextmanager
def open_run(config: TrainConfig, robot: Robot | None = None) -> Iterator[OpenRun]:
    """Open the run folder of a configuration, alone, until the context ends.

    A folder that holds this run is continued; one that was killed before its first checkpoint is
    started anew. Files that a run does not write are never touched. Refused or not, all that is
    written before `OpenRun.begin` is the folder with its lock.

    Args:
        config: the run.
        robot: that it is of, where it is none of the built-in ones.

    Raises:
        RunError: the folder holds another run (names what differs), or a longer one, or one whose
            checkpoint is gone, or no run but other files, or a checkpoint that cannot be read, or
            is packed, or is in use by another process.
        FbidError: the arguments of the environment are not valid.
    """
    folder, asked = RunFolder.to_write(config.folder), config.to_json()
    archive = None if config.overwrite else packed_in(config.folder)
    if archive is not None:
        raise RunError(
            f"{config.folder}: is packed in {archive}. Choose another --out, or --overwrite to "
            "start anew beside it."
        )
    means = meaning(asked, robot)
    _check_same_run(folder, config, asked)
    folder.path.mkdir(parents=True, exist_ok=True)
    with _locked(folder):
        # Again: another process may have had the folder in between.
        resumes = _check_same_run(folder, config, asked)
        changes = _changes(folder, means) if resumes else ()
        yield OpenRun(folder, asked, means, resumes, robot, changes)


def _check_same_run(folder: RunFolder, config: TrainConfig, asked: Mapping[str, Any]) -> bool:
    """Return whether the folder holds a checkpoint of this run; RunError if it is not ours."""
    path = folder.path
    if not path.exists():
        return False
    if not path.is_dir():
        raise RunError(f"{path}: is a file. Expected a run folder or a new one.")
    if not folder.config.exists():
        own = folder.results if config.overwrite else folder.beginnings
        foreign = sorted({*path.iterdir()} - own - {folder.lock})
        if foreign:
            names = ", ".join(entry.name for entry in foreign[:3])
            raise RunError(
                f"{path}: holds {names} but no {folder.config.name}, so it is not a run folder. "
                "Expected a run folder, an empty one or a new one."
            )
        return False
    stored = read_json(folder.config)
    if config.overwrite:
        return False
    anew = "Choose another --out, or --overwrite to start anew."
    if different := run_differences(stored, asked):
        raise RunError(f"{path}: holds another run: asked for {in_words(different)}. {anew}")
    trained = last_steps(folder.progress)
    if not folder.checkpoint.exists():
        if (before := folder.older[0]).exists():
            raise RunError(f"{before}: of an earlier version, and not read any more. {anew}")
        if _had_checkpoint(folder, config, stored):
            raise RunError(
                f"{path}: holds a run of {trained} steps without the checkpoint that it would go "
                f"on from. {anew}"
            )
        return False
    if trained >= config.total_steps + config.iteration_steps:
        raise RunError(
            f"{path}: is trained for {trained} steps, which total_steps {config.total_steps} would "
            f"deny. {anew}"
        )
    load_bundle(folder.checkpoint, RunError)
    return True


def _had_checkpoint(folder: RunFolder, config: TrainConfig, stored: Mapping[str, Any]) -> bool:
    """Whether a run came farther than one does that is killed before its first checkpoint."""
    trained, evaluated = last_steps(folder.progress), last_steps(folder.evaluations)
    every, total = stored.get("checkpoint_every"), stored.get("total_steps")
    if isinstance(every, int) and every and trained >= every + config.iteration_steps:
        return True
    measured = evaluated if config.eval.every else folder.exported_steps
    return isinstance(total, int) and measured >= trained >= total


def _changes(folder: RunFolder, means: Mapping[str, Any] | None) -> tuple[str, ...]:
    """Return the differences from the beginning of the run, in words."""
    found: list[Difference] = []
    try:
        found += differences(made_with(read_json(folder.versions)), made_with(versions()))
        # Absent in runs that began before it was written.
        if means is not None and folder.environment.exists():
            found += environment_differences(read_json(folder.environment), means)
    except (OSError, RunError) as reason:
        return (f"what it began with cannot be read ({reason})",)
    return tuple(map(str, found))


@contextmanager
def _locked(folder: RunFolder) -> Iterator[None]:
    """Hold the folder; the lock ends with the process, however that ends."""
    with folder.lock.open("a+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as reason:
            file.seek(0)
            raise RunError(
                f"{folder.path}: is being trained by process {file.read().strip() or 'unknown'}. "
                "Wait for it, or choose another --out."
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
