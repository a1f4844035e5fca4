"""One short training per environment, and their learning curves: `make survey`.

Enough to see that every environment can be learnt from, not to compare layers: that takes seeds,
see `eval.compare`. Interrupted, the same command continues where the runs were.
"""

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
from fbid_gym.checks import check_choices, check_positive
from fbid_gym.envs import ENVIRONMENTS
from train.runs.config import EvaluationConfig, TrainConfig, cores
from train.runs.exit_status import exit_status
from train.runs.folder import RunFolder
from train.runs.jobs import run_jobs
from train.runs.tables import read_rows, to_csv
from train.runs.training import training_job

LAYERS = {
    "balance": ("com_wrench", "joint_position"),
    "squat": ("joint_position_feedforward", "joint_position"),
    "step": ("base_acceleration", "joint_position"),
    "crawl": ("base_acceleration", "joint_position"),
    "walk": ("base_acceleration", "joint_position"),
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


def trainings(config: SurveyConfig) -> list[TrainConfig]:
    """Return the runs in the order in which they are started."""
    check_choices("environment", config.envs, ENVIRONMENTS)
    check_positive(total_steps=config.total_steps, evaluations=config.evaluations)
    every = max(config.total_steps // config.evaluations, 1)
    found = []
    for env in config.envs:
        task = ENVIRONMENTS[env]["task"]
        for layer in LAYERS[task]:
            found.append(
                TrainConfig(
                    env=env,
                    action_layer=layer,
                    env_args=dict(ARGUMENTS.get(task, {})),
                    seed=config.seed,
                    total_steps=config.total_steps,
                    num_threads=1,
                    out=config.out / f"{_short(env)}-{layer}",
                    eval=EvaluationConfig(every=every, episodes=config.episodes),
                )
            )
    return found


def exploring(run: TrainConfig) -> tuple[list[float], list[float]]:
    """Return steps and the mean return of the latest episodes of training, noise included."""
    rows = [
        (float(row["steps"]), float(row["return_mean"]))
        for row in read_rows(RunFolder.of(run.folder).progress)
    ]
    known = [(step, mean) for step, mean in rows if math.isfinite(mean)]
    return [step for step, _ in known], [mean for _, mean in known]


def evaluations(run: TrainConfig) -> list[dict[str, str]]:
    """Return the rows of a run's evaluations."""
    return read_rows(RunFolder.of(run.folder).evaluations)


def curves(every: Sequence[TrainConfig]) -> str:
    """Return the evaluations of all runs as CSV, with the return of training at that time."""
    rows = []
    for run in every:
        trained, means = exploring(run)
        known = {"env": run.env, "layer": run.action_layer, "seed": run.seed}
        for row in evaluations(run):
            until = bisect_right(trained, float(row["steps"]))
            rows.append({**known, **row, "return_exploring": means[until - 1] if until else ""})
    return to_csv(_COLUMNS_OF_CSV, rows)


def drawn(every: Sequence[TrainConfig]) -> str:
    """Return the learning curves as SVG: a panel per environment, mean and middle half.

    Thin: the return with the noise of exploration, which is what PPO climbs.
    """
    by_env: dict[str, list[TrainConfig]] = {}
    for run in every:
        by_env.setdefault(run.env, []).append(run)
    return sheet([_panel(env, its) for env, its in by_env.items()])


def _panel(env: str, its: Sequence[TrainConfig]) -> str:
    series = []
    for colour, run in enumerate(its):
        table = evaluations(run)
        steps, mean, low, high = (
            [float(row[name]) for row in table]
            for name in ("steps", "return_mean", "return_q25", "return_q75")
        )
        series.append(
            Series(
                run.action_layer,
                colour,
                steps,
                mean,
                low,
                high,
                singles=(exploring(run),),
                dots=True,
            )  # fmt: skip
        )
    arguments = ARGUMENTS.get(ENVIRONMENTS[env]["task"], {})
    title = [_short(env), *(f"{name} {value:g}" for name, value in arguments.items())]
    return panel(series, f"return, {', '.join(title)}", "steps", x_format=steps_text)


def _short(env: str) -> str:
    """Return the environment's id without its namespace."""
    return env.rpartition("/")[2]


def _title(run: TrainConfig) -> str:
    return f"{_short(run.env)}, {run.action_layer}"


def main(config: SurveyConfig) -> int:
    """Train, draw; return the exit status."""
    console = Console()
    every = trainings(config)
    if run_jobs([training_job(_title(one), one) for one in every], config.jobs, console):
        console.print("Not every training has finished; the same command continues.")
        return 1
    write(config.figure.with_suffix(".csv"), curves(every))
    write(config.figure, drawn(every))
    for one in every:
        first, *_, last = evaluations(one)
        _, means = exploring(one)
        console.print(
            f"{_title(one)}: return {float(first['return_mean']):.0f} -> "
            f"{float(last['return_mean']):.0f}, survival {float(last['survival']):.0%}; "
            f"exploring {means[0]:.0f} -> {means[-1]:.0f}"
        )
    console.print(f"Learning curves: {config.figure}")
    return 0


if __name__ == "__main__":
    chosen = tyro.cli(SurveyConfig, prog="python -m eval.survey")
    sys.exit(exit_status(lambda: main(chosen)))
