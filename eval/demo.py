"""Train two action layers with two seeds each, compare them, leave a report: `make demo`.

Every training is a `python -m train.ppo` of its own with its folder under `runs/demo`, one core
each. Interrupted, the same command continues where they were.
"""

import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import tyro
from rich.console import Console
from rich.table import Table

from eval.compare import main as compare
from fbid_gym.errors import FbidError
from train.runs.config import EvaluationConfig, TrainConfig, cores
from train.runs.folder import RunFolder
from train.runs.jobs import run_jobs
from train.runs.tables import read_rows
from train.runs.training import training_job


@dataclass(frozen=True)
class DemoConfig:
    """Train two action layers with two seeds each, compare them, leave a report."""

    out: Path = Path("runs/demo")
    """Folder of the runs and of report.html."""
    env: str = "fbid_gym/BipedBalance-v0"
    """Environment id."""
    layers: tuple[str, ...] = ("base_acceleration", "joint_position")
    """Action layers. The slowest first keeps all cores busy to the end."""
    seeds: tuple[int, ...] = (0, 1)
    """Seeds of each layer."""
    total_steps: int = 180_000
    """Environment steps of each run."""
    evaluations: int = 5
    """Evaluations of each run, evenly spread."""
    episodes: int = 16
    """Episodes of each evaluation."""
    jobs: int = field(default_factory=lambda: cores())
    """Runs at the same time, one core each."""


def trainings(config: DemoConfig) -> dict[tuple[str, int], TrainConfig]:
    """Return the runs by layer and seed, in the order in which they are started."""
    every = max(config.total_steps // config.evaluations, 1)
    return {
        (layer, seed): TrainConfig(
            env=config.env,
            action_layer=layer,
            seed=seed,
            total_steps=config.total_steps,
            num_threads=1,
            out=config.out / f"{layer}-s{seed}",
            eval=EvaluationConfig(every=every, episodes=config.episodes),
        )
        for layer in config.layers
        for seed in config.seeds
    }


def table(every: Mapping[tuple[str, int], TrainConfig]) -> Table:
    """Return what the runs came to."""
    names = ("layer", "seed", "before", "after", "best", "survival", "minutes")
    found = Table(*names, title="Return at evaluation")
    for (layer, seed), training in every.items():
        rows = read_rows(RunFolder.of(training.folder).evaluations)
        first, last = rows[0], rows[-1]
        best = max(float(row["return_mean"]) for row in rows)
        found.add_row(
            layer,
            str(seed),
            f"{float(first['return_mean']):.0f}",
            f"{float(last['return_mean']):.0f}",
            f"{best:.0f}",
            f"{float(last['survival']):.0%}",
            f"{float(last['wall_seconds']) / 60:.1f}",
        )
    return found


def main(config: DemoConfig) -> int:
    """Train, compare, report; return the exit status."""
    console = Console()
    began = time.monotonic()
    every = trainings(config)
    jobs = [training_job(f"{layer}, seed {seed}", its) for (layer, seed), its in every.items()]
    if run_jobs(jobs, config.jobs, console):
        console.print("Not every training has finished; the same command continues.")
        return 1
    report = config.out / "report.html"
    status = compare([*(str(its.folder) for its in every.values()), "--out", str(report)])
    if status != 0:
        return status
    console.print(table(every))
    console.print(f"{(time.monotonic() - began) / 60:.1f} minutes. Report: {report}")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(tyro.cli(DemoConfig, prog="python -m eval.demo")))
    except FbidError as error:
        sys.exit(f"error: {error}")
