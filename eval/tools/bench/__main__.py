"""Measure the cost of the layers: `python -m eval.tools.bench`.

Every figure is a ratio of two things measured in turns within one run, or comes with the yardstick
it is compared to, because machines differ and the same machine differs from minute to minute.
"""

import os
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro

from eval.page.docs import BENCHMARK_PAGE, splice, spliced
from eval.tools.bench import environments, laws, layers, learning, processes
from eval.tools.bench.figures import FigureTable
from fbid_gym.actions import LAYERS
from fbid_gym.envs.chunks import NUM_ENVS
from fbid_gym.options import Choice, Each, Whole
from fbid_gym.robots import ROBOTS
from train.command import run_command
from train.runs.files import check_folder, to_json, write
from train.runs.versions import versions

MEASURES: dict[str, Callable[["BenchConfig"], FigureTable]] = {
    "laws": lambda c: laws.per_tick(c.robots, c.num_envs, c.rounds),
    "controllers": lambda c: layers.on_their_tasks(c.num_envs, c.rounds),
    "walking": lambda c: layers.walking(c.num_envs, c.rounds),
    "conditions": lambda c: layers.conditions(c.num_envs, c.rounds),
    "layers": lambda c: environments.by_layer(c.robots, c.chosen, c.num_envs, c.rounds),
    "threads": lambda c: environments.by_threads(c.robots, c.chosen, c.num_envs, c.rounds),
    "several": lambda c: environments.several_robots(c.rounds),
    "single": lambda c: layers.single(c.robots, c.chosen, c.rounds),
    "runtime": lambda c: layers.controller(layers.CONTROLLED, c.rounds),
    "ppo": lambda c: learning.frames(c.chosen, c.rounds),
    "memory": lambda c: processes.resident(c.robots),
    "first_use": lambda c: processes.first_use(),
}
"""Name of a section -> what measures it."""


@dataclass(frozen=True)
class BenchConfig:
    """Measure what the action layers cost."""

    sections: Annotated[
        tuple[str, ...],
        Each(Choice(MEASURES, "section")),
        tyro.conf.arg(metavar=f"[{{{','.join(MEASURES)}}} [...]]"),
    ] = tuple(MEASURES)
    """What to measure: the laws per control tick, layers on the tasks they are for, walking beside
    its physics, sensors and motors of robots, environment steps by layer, by thread and of several
    robots in one batch, a single robot, a robot's controller, PPO beside Humanoid-v5, resident
    memory, a first use with nothing compiled."""
    robots: Annotated[tuple[str, ...], Each(Choice(ROBOTS, "robot"))] = tuple(ROBOTS)
    """Built-in robots."""
    layers: Annotated[tuple[str, ...], Each(Choice(LAYERS, "action layer"))] = tuple(LAYERS)
    """Action layers. `torque` is always among them: the others are compared to it."""
    num_envs: Annotated[int, NUM_ENVS] = 64
    """Robots side by side."""
    rounds: Annotated[int, Whole(1, 10_000)] = 9
    """Rounds; every figure is the median over them."""
    out: Path = Path("runs/bench")
    """Folder for bench.json and bench.md."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Put the tables into docs/benchmark.md."""

    @property
    def chosen(self) -> list[str]:
        """The layers, with the one that they are compared to."""
        return list(dict.fromkeys(["torque", *self.layers]))


def main(config: BenchConfig) -> None:
    """Measure, print, write; what can be refused is refused before."""
    check_folder(config.out, "out")
    if config.write_docs:
        spliced(BENCHMARK_PAGE, "")  # before minutes of measuring
    load = os.getloadavg()[0]
    if load > 0.5:
        print(f"Load average {load:.1f}: what else runs here distorts the ratios.", file=sys.stderr)
    sections = []
    for name in config.sections:
        sections.append(MEASURES[name](config))
        print(sections[-1].markdown(), end="\n\n", flush=True)
    tables = "\n\n".join(section.markdown() for section in sections)
    data = {
        "versions": versions(),
        "load_average_before": load,
        "num_envs": config.num_envs,
        "rounds": config.rounds,
        "sections": [asdict(section) for section in sections],
    }
    write(config.out / "bench.json", to_json(data))
    write(config.out / "bench.md", tables + "\n")
    if config.write_docs:
        splice(BENCHMARK_PAGE, tables)


if __name__ == "__main__":
    sys.exit(run_command("eval.tools.bench", BenchConfig, main))
