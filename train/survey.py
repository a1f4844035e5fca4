"""One short training per environment, and their learning curves: `make survey`.

Enough to see that every environment can be learnt from, not to compare layers: that takes seeds,
see `eval.compare`. Interrupted, the same command continues where the runs were.
"""

import csv
import io
import json
import math
import sys
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import tyro
from rich.console import Console

from eval.files import write
from eval.plots import Series, panel, sheet
from eval.wording import steps as steps_text
from fbid_gym.envs import ENVIRONMENTS
from train.config import cores
from train.parallel import Job, train

LAYERS = {
    "balance": ("com_wrench", "joint_position"),
    "squat": ("joint_position_feedforward", "joint_position"),
    "step": ("base_acceleration", "joint_position"),
    "crawl": ("base_acceleration", "joint_position"),
}
"""Task -> the layers to train it through."""

ARGUMENTS: dict[str, dict[str, float]] = {"squat": {"speed": 5.0}}
"""Task -> arguments that leave something to learn: slowly every layer squats without a policy."""

_COLUMNS_OF_CSV = ("env", "layer", "seed", "steps", "episodes", "return_mean", "return_q25",
                   "return_q75", "survival", "return_exploring")  # fmt: skip


@dataclass(frozen=True)
class SurveyConfig:
    """Train once on every environment and draw the learning curves."""

    out: Path = Path("runs/survey")
    """Folder of the runs."""
    figure: Path = Path("docs/learning.svg")
    """The learning curves, drawn; their numbers go beside it as CSV."""
    envs: tuple[str, ...] = tuple(
        name for name in ENVIRONMENTS
        if name not in ("fbid_gym/BipedBalance-v0", "fbid_gym/QuadrupedBalance-v0")
    )  # fmt: skip
    """Environment ids; by default those that the demo does not train on."""
    total_steps: int = 300_000
    """Environment steps of each run."""
    evaluations: int = 6
    """Evaluations of each run, evenly spread."""
    episodes: int = 32
    """Episodes of each evaluation."""
    seed: int = 0
    """Seed of each run."""
    jobs: int = field(default_factory=lambda: cores())
    """Runs at the same time, one core each."""


@dataclass(frozen=True)
class Run:
    """One training of the survey."""

    env: str
    layer: str
    job: Job

    @property
    def title(self) -> str:
        """For people."""
        return f"{self.env.rpartition('/')[2]}, {self.layer}"


def runs(config: SurveyConfig) -> list[Run]:
    """Return the runs in the order in which they are started."""
    every = str(max(config.total_steps // config.evaluations, 1))
    found = []
    for env in config.envs:
        task = ENVIRONMENTS[env]["task"]
        for layer in LAYERS[task]:
            name = f"{env.rpartition('/')[2]}-{layer}"
            options = (
                *("--env", env, "--action-layer", layer, "--seed", str(config.seed)),
                *("--env-args", json.dumps(ARGUMENTS.get(task, {}))),
                *("--eval.every", every, "--eval.episodes", str(config.episodes)),
            )
            job = Job(
                f"{env.rpartition('/')[2]}, {layer}",
                config.out / name,
                config.out / "logs" / f"{name}.log",
                config.total_steps,
                options,
            )
            found.append(Run(env, layer, job))
    return found


def exploring(run: Run) -> tuple[list[float], list[float]]:
    """Return steps and the mean return of the latest episodes of training, noise included."""
    rows = [
        (float(row["steps"]), float(row["return_mean"])) for row in run.job.rows("progress.csv")
    ]
    known = [(step, mean) for step, mean in rows if math.isfinite(mean)]
    return [step for step, _ in known], [mean for _, mean in known]


def curves(every: Sequence[Run], seed: int) -> str:
    """Return the evaluations of all runs as CSV, with the return of training at that time."""
    text = io.StringIO()
    writer = csv.DictWriter(text, _COLUMNS_OF_CSV, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    for run in every:
        trained, means = exploring(run)
        for row in run.job.rows("evaluations.csv"):
            until = bisect_right(trained, float(row["steps"]))
            noisy = {"return_exploring": means[until - 1] if until else ""}
            writer.writerow({"env": run.env, "layer": run.layer, "seed": seed, **row, **noisy})
    return text.getvalue()


def drawn(every: Sequence[Run]) -> str:
    """Return the learning curves as SVG: a panel per environment, mean and middle half.

    Thin: the return with the noise of exploration, which is what PPO climbs.
    """
    by_env: dict[str, list[Run]] = {}
    for run in every:
        by_env.setdefault(run.env, []).append(run)
    return sheet([_panel(env, its) for env, its in by_env.items()])


def _panel(env: str, its: Sequence[Run]) -> str:
    series = []
    for colour, run in enumerate(its):
        table = run.job.rows("evaluations.csv")
        steps, mean, low, high = (
            [float(row[name]) for row in table]
            for name in ("steps", "return_mean", "return_q25", "return_q75")
        )
        series.append(
            Series(run.layer, colour, steps, mean, low, high, singles=(exploring(run),), dots=True)
        )
    arguments = ARGUMENTS.get(ENVIRONMENTS[env]["task"], {})
    title = [env.rpartition("/")[2], *(f"{name} {value:g}" for name, value in arguments.items())]
    return panel(series, f"return, {', '.join(title)}", "steps", x_format=steps_text)


def main(config: SurveyConfig) -> int:
    """Train, draw; return the exit status."""
    console = Console()
    every = runs(config)
    if not train([run.job for run in every], config.jobs, console):
        return 1
    write(config.figure.with_suffix(".csv"), curves(every, config.seed))
    write(config.figure, drawn(every))
    for run in every:
        first, *_, last = run.job.rows("evaluations.csv")
        _, means = exploring(run)
        console.print(
            f"{run.title}: return {float(first['return_mean']):.0f} -> "
            f"{float(last['return_mean']):.0f}, survival {float(last['survival']):.0%}; "
            f"exploring {means[0]:.0f} -> {means[-1]:.0f}"
        )
    console.print(f"Learning curves: {config.figure}")
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(SurveyConfig, prog="python -m train.survey")))
