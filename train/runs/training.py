"""A training among the jobs that run side by side."""

import math
import re
import sys
from pathlib import Path
from typing import NamedTuple

from train.runs.command_line import options
from train.runs.config import TrainConfig
from train.runs.folder import RunFolder
from train.runs.jobs import Job, Progress
from train.runs.tables import read_rows


def training_job(name: str, config: TrainConfig) -> Job:
    """Return a `python -m train.ppo`, or another algorithm's, as a job, its log that of `log_of`.

    Started again it continues where it was.
    """
    command = (sys.executable, "-m", f"train.{config.algorithm}", *options(config))
    return Job(name, command, log_of(config), lambda: progress(config))


class Standing(NamedTuple):
    """Where a training is."""

    state: str
    """"done", "failed", "not begun", or the share of its steps, such as "40%"."""
    note: str
    """What it came to so far; of a failed one, the last line of its log."""


_ENDED_BY = re.compile(r"(error|[\w.]*(Error|Exception))\b")


def standing(config: TrainConfig) -> Standing:
    """Return where a training is, by its run folder and the log of its job."""
    share, note = progress(config)
    if share >= 1.0:
        return Standing("done", note)
    said = last_line(config)
    if _ENDED_BY.match(said):
        return Standing("failed", said)
    begun = RunFolder.of(config.folder).config.is_file()
    return Standing(f"{share:.0%}" if begun else "not begun", note)


def last_line(config: TrainConfig) -> str:
    """Return the last line of the log of a training that ran as a job; empty without one."""
    log = log_of(config)
    lines = log.read_text(errors="replace").splitlines() if log.is_file() else []
    return lines[-1] if lines else ""


def log_of(config: TrainConfig) -> Path:
    """Return where the output of a training goes that runs as a job."""
    return config.folder.parent / "logs" / f"{config.folder.name}.log"


def progress(config: TrainConfig) -> Progress:
    """Return how far a training is, with its latest evaluation in words."""
    folder, total = RunFolder.of(config.folder), config.total_steps
    rows, evaluations = read_rows(folder.progress), read_rows(folder.evaluations)
    steps = int(rows[-1]["steps"]) if rows else 0
    note = f"{steps} of {total} steps"
    if evaluations:
        latest, survival = (float(evaluations[-1][name]) for name in ("return_mean", "survival"))
        note += f", return {latest:.0f}, survival {survival:.0%}"
        error = float(evaluations[-1].get("velocity_error", "nan"))
        note += f", velocity error {error:.2f} m/s" if math.isfinite(error) else ""
    return Progress(min(steps / total, 1.0), note)
