"""A quadruped walks, learns through two action layers, and is compared: `make demo`.

First a video of the zero action, which walks before anything is learnt; then two seeds of each
layer, and a report. Other environments are given as ARGS="--env fbid_gym/BipedBalance-v0".

Every training is a `python -m train.ppo` of its own with its folder under `runs/demo`, one core
each. Interrupted, the same command continues where they were.
"""

import sys
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from rich.console import Console

from eval.compare import main as compare
from eval.rollout import Player, filmed
from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.options import Choice, Each, Number, Whole
from train.command import run_command
from train.recipes import config_for
from train.runs import robots
from train.runs.config import EvaluationConfig, TrainConfig, cores
from train.runs.files import check_folder, check_output, write
from train.runs.jobs import run_jobs
from train.runs.training import training_job


@dataclass(frozen=True)
class DemoConfig:
    """Film the zero action, train two action layers with two seeds each, compare, report."""

    out: Path = Path("runs/demo")
    """Folder of the runs and of report.html."""
    env: str = "fbid_gym/QuadrupedWalk-v0"
    """Environment id. How to train in it is its recipe's, in train/recipes."""
    robot: str | None = None
    """Instead of the environment's: a built-in robot, or your own: an MJCF, a URDF, a robot.toml
    or a robot.zip."""
    feet: tuple[str, ...] = ()
    """Of your own robot: names of bodies, sites or spheres, or '{"left": ["heel", "toe"]}'."""
    layers: Annotated[tuple[str, ...], Each(Choice(LAYERS, "action layer"))] = (
        "base_acceleration",
        "joint_position",
    )
    """Action layers. The slowest first keeps all cores busy to the end."""
    seeds: Annotated[tuple[int, ...], Each(Whole(0, 2**31))] = (0, 1)
    """Seeds of each layer."""
    total_steps: Annotated[int, Whole(1, 10**12)] = 245_760
    """Environment steps of each run."""
    evaluations: Annotated[int, Whole(1, 1000)] = 5
    """Evaluations of each run, evenly spread."""
    episodes: Annotated[int, Whole(1, 65_536)] = 16
    """Episodes of each evaluation."""
    video_seconds: Annotated[float, Number(0.0, 600.0, "s")] = 8.0
    """Length of the videos, s. 0: none."""
    jobs: Annotated[int, Whole(1, 1024)] = field(default_factory=lambda: cores())
    """Runs at the same time, one core each."""


_HARDER: dict[str, dict[str, Any]] = {
    "walk": {"pushes": (0.4, 0.8, 1.2, 1.6, 2.0), "video_push": 0.8}
}
"""Task -> settings of the comparison, where pushes of the training make nobody fall."""


def trainings(config: DemoConfig) -> dict[tuple[str, int], TrainConfig]:
    """Return the runs by layer and seed, in the order in which they are started."""
    every = max(config.total_steps // config.evaluations, 1)
    return {
        (layer, seed): replace(
            config_for(config.env, layer),
            robot=config.robot,
            feet=config.feet,
            seed=seed,
            total_steps=config.total_steps,
            num_threads=1,
            out=config.out / f"{layer}-s{seed}",
            eval=EvaluationConfig(every=every, episodes=config.episodes),
        )
        for layer in config.layers
        for seed in config.seeds
    }


def film_zero_action(config: DemoConfig) -> Path:
    """Record what the first layer does before any training; return the file."""
    path = config.out / "zero_action.mp4"
    check_output(path, "out", (".mp4",))
    first = next(iter(trainings(config).values()))
    robot = robots.chosen(config.robot, config.feet)
    player = Player("zero action", first.env, first.make_args(), None, robot)
    title = f"{first.action_layer}, zero action"
    clip = filmed(player, first.eval.seed, config.video_seconds, title)
    write(path, clip.mp4())
    return path


def compared(config: DemoConfig, report: Path) -> list[str]:
    """Return the command line of the comparison."""
    settings: dict[str, Any] = {"video_seconds": config.video_seconds}
    settings |= _HARDER.get(ENVIRONMENTS.get(config.env, {}).get("task", ""), {})
    words = [*(str(its.folder) for its in trainings(config).values()), "--out", str(report)]
    for name, value in settings.items():
        words += [f"--{name.replace('_', '-')}"]
        words += map(str, value if isinstance(value, tuple) else [value])
    return words


def main(config: DemoConfig) -> int:
    """Film, train, compare, report; return the exit status."""
    check_folder(config.out, "out")
    console = Console()
    began = time.monotonic()
    if config.video_seconds > 0:
        console.print(f"Before any training: {film_zero_action(config)}", markup=False)
    every = trainings(config)
    jobs = [training_job(f"{layer}, seed {seed}", its) for (layer, seed), its in every.items()]
    if run_jobs(jobs, config.jobs, console):
        console.print("Not every training has finished; the same command continues.")
        return 1
    report = config.out / "report.html"
    status = compare(compared(config, report))
    if status != 0:
        return status
    console.print(f"{(time.monotonic() - began) / 60:.1f} minutes. Report: {report}", markup=False)
    return 0


if __name__ == "__main__":
    sys.exit(run_command("eval.demo", DemoConfig, main))
