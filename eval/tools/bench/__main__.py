"""What the layers cost: `python -m eval.tools.bench`.

Every figure is a ratio of two things measured in turns within one run, or comes with the yardstick
it is compared to, because machines differ and the same machine differs from minute to minute.
"""

import os
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from eval.files import check_folder, to_json, write
from eval.page.docs import BENCHMARK_PAGE, splice, spliced
from eval.tools.bench import environments, laws, layers, learning, processes
from eval.tools.bench.figures import Section
from fbid_gym.actions import LAYERS
from fbid_gym.envs.chunks import NUM_ENVS
from fbid_gym.options import Choice, Each, Whole, check_fields
from fbid_gym.robots import ROBOTS
from train.command import run_command
from train.runs.versions import versions

SectionName = Literal[
    "laws",
    "controllers",
    "walking",
    "conditions",
    "layers",
    "threads",
    "several",
    "single",
    "runtime",
    "ppo",
    "memory",
    "first_use",
]


@dataclass(frozen=True)
class BenchConfig:
    """Measure what the action layers cost."""

    sections: Annotated[tuple[SectionName, ...], Each(Choice(get_args(SectionName)))] = get_args(
        SectionName
    )
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


def measure(config: BenchConfig, show: Callable[[Section], None]) -> list[Section]:
    """Measure the chosen sections in order, showing each when it is done."""
    robots = list(config.robots)
    chosen = list(dict.fromkeys(["torque", *config.layers]))
    rounds = config.rounds
    measures: dict[SectionName, Callable[[], Section]] = {
        "laws": lambda: laws.per_tick(robots, config.num_envs, rounds),
        "controllers": lambda: layers.on_their_tasks(config.num_envs, rounds),
        "walking": lambda: layers.walking(config.num_envs, rounds),
        "conditions": lambda: layers.conditions(config.num_envs, rounds),
        "layers": lambda: environments.by_layer(robots, chosen, config.num_envs, rounds),
        "threads": lambda: environments.by_threads(robots, chosen, config.num_envs, rounds),
        "several": lambda: environments.several_robots(rounds),
        "single": lambda: layers.single(robots, chosen, rounds),
        "runtime": lambda: layers.controller(layers.CONTROLLED, rounds),
        "ppo": lambda: learning.frames(chosen, rounds),
        "memory": lambda: processes.resident(robots),
        "first_use": processes.first_use,
    }
    sections = []
    for name in config.sections:
        section = measures[name]()
        show(section)
        sections.append(section)
    return sections


def main(config: BenchConfig) -> None:
    """Measure, print, write; what can be refused is refused before."""
    check_fields(config)
    check_folder(config.out, "out")
    if config.write_docs:
        spliced(BENCHMARK_PAGE, "")  # before minutes of measuring
    load = os.getloadavg()[0]
    if load > 0.5:
        print(f"Load average {load:.1f}: what else runs here distorts the ratios.", file=sys.stderr)
    sections = measure(config, lambda section: print(section.markdown(), end="\n\n", flush=True))
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
