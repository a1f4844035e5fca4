"""A training among the jobs that run side by side."""

import math
import re
import sys
from pathlib import Path
from typing import NamedTuple

from fbid_gym.errors import RunError
from train.runs.command_line import options
from train.runs.config import TrainConfig
from train.runs.folder import RunFolder
from train.runs.jobs import Job, Progress, last_lines
from train.runs.tables import read_rows


def training_job(name: str, config: TrainConfig) -> Job:
    """Return a `python -m train.ppo`, or another algorithm's, as a job, its log that of `log_of`.

    Started again it continues where it was.
    """
    command = (sys.executable, "-m", f"train.{config.algorithm}", *options(config))
    return Job(name, command, log_of(config), lambda: progress(config))


class Status(NamedTuple):
    """Status of a training."""

    state: str  # "done", "failed", "not begun", or the share of its steps, such as "40%"
    note: str  # its result so far; of a failed one, the last line of its log


_ALMOST = 0.99
"""Share of what took its last step and has not come to its end after it."""
_ENDED_BY = re.compile(r"(error|[\w.]*(Error|Exception))\b")


def standing(config: TrainConfig) -> Status:
    """Return where a training is, by its run folder and the log of its job."""
    share, note = progress(config)
    if share >= 1.0:
        return Status("done", note)
    said = last_line(config)
    if _ENDED_BY.match(said):
        return Status("failed", said)
    begun = RunFolder.of(config.folder).config.is_file()
    return Status(f"{share:.0%}" if begun else "not begun", note)


def last_line(config: TrainConfig) -> str:
    """Return the last line of the log of a training that ran as a job; empty without one."""
    return next(iter(last_lines(log_of(config), 1)), "")


def log_of(config: TrainConfig) -> Path:
    """Return where the output of a training goes that runs as a job."""
    return config.folder.parent / "logs" / f"{config.folder.name}.log"


def progress(config: TrainConfig) -> Progress:
    """Return how far a training is, with its latest evaluation in words.

    What took its last step and has not been evaluated after it, or, where nothing is evaluated, has
    exported no policy after it, is not at its end.

    Raises:
        RunError: its tables cannot be read, or hold something else.
    """
    folder = RunFolder.of(config.folder)
    rows, evaluations = read_rows(folder.progress), read_rows(folder.evaluations)
    try:
        exported = 0 if config.eval.every else folder.exported_steps
        return _progress(config, rows[-1:], evaluations[-1:], exported)
    except (KeyError, TypeError, ValueError) as error:
        raise RunError(f"{folder.path}: its tables are not those of a training.") from error


def is_finished(config: TrainConfig) -> bool:
    """Return whether a training is at its end, see `progress`."""
    return progress(config).share >= 1.0


def _progress(
    config: TrainConfig, row: list[dict[str, str]], evaluation: list[dict[str, str]], exported: int
) -> Progress:
    steps, total = int(row[0]["steps"]) if row else 0, config.total_steps
    note, share = f"{steps} of {total} steps", min(steps / total, 1.0)
    evaluated = 0.0
    for its in evaluation:
        evaluated = float(its["steps"])
        note += f", return {float(its['return_mean']):.0f}, survival {float(its['survival']):.0%}"
        error = float(its.get("velocity_error", "nan"))
        note += f", velocity error {error:.2f} m/s" if math.isfinite(error) else ""
    if (evaluated if config.eval.every else exported) < total:
        share = min(share, _ALMOST)
    return Progress(share, note)
