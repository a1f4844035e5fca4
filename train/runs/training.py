"""A training among the jobs that run side by side."""

import math
import sys
from pathlib import Path

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
