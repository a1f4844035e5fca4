"""Look for growth and losses as environments run for long: `python -m eval.tools.soak`.

Every layer takes steps with random actions in a batch of robots whose episodes are short, so that
resets are frequent. What comes out has to be numbers. Memory, file descriptors and threads are read
at intervals: what a process keeps after its first steps is its own; what counts is growth from the
end of the first fifth on.
"""

import gc
import sys
import time
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
import psutil
import tyro

from eval.page.docs import RELIABILITY_PAGE, markdown_table, splice, spliced
from eval.wording import count
from fbid_gym.actions import LAYERS
from fbid_gym.checks import check_positive
from train.command import run_command
from train.environments import make_envs

MOST_GROWTH = 0.01  # share of the memory


@dataclass(frozen=True)
class SoakConfig:
    """Run environments for long, and tell what grows."""

    env: str = "fbid_gym/BipedBalance-v0"
    """The environment."""
    layers: tuple[str, ...] = tuple(LAYERS)
    """Action layers, one after another."""
    steps: float = 1e7
    """Environment steps, of all layers together."""
    num_envs: int = 64
    """Robots side by side."""
    num_threads: int = 2
    """Threads they are spread over."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Put the table into docs/reliability.md."""


class Reading(NamedTuple):
    """Resources that a process holds."""

    memory: int  # bytes, resident
    files: int  # file descriptors
    threads: int  # of the system


class Soaked(NamedTuple):
    """Result of one layer."""

    layer: str
    steps: int  # environment steps
    ticks: int  # of the layer, in these
    lost: int  # robots that were given an observation or a reward that is no number
    resets: int  # ends of episodes
    first: Reading  # at the end of the first fifth
    last: Reading  # at the end

    @property
    def growth(self) -> float:
        """Share by which memory grew."""
        return self.last.memory / self.first.memory - 1.0

    @property
    def held(self) -> bool:
        """Whether nothing grew that must not, and nothing was lost."""
        return (
            self.lost == 0
            and self.growth < MOST_GROWTH
            and self.last.files <= self.first.files
            and self.last.threads <= self.first.threads
        )


def read() -> Reading:
    """Read what this process holds."""
    gc.collect()
    process = psutil.Process()
    return Reading(process.memory_info().rss, process.num_fds(), process.num_threads())


def soak(config: SoakConfig, layer: str) -> Soaked:
    """Run the environment through a layer."""
    given = {"num_threads": config.num_threads, "action_layer": layer, "episode_seconds": 1.0}
    envs = make_envs(config.env, given, config.num_envs)
    fifth = max(round(config.steps / len(config.layers) / config.num_envs / 5), 1)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    readings, resets, lost = [], 0, 0
    for part in (fifth, 4 * fifth):
        for _ in range(part):
            seen, reward, terminated, truncated, _ = envs.step(envs.action_space.sample())
            resets += int((terminated | truncated).sum())
            lost += int((~np.isfinite(np.column_stack([seen, reward])).all(axis=1)).sum())
        readings.append(read())
    envs.close()
    steps = 5 * fifth * config.num_envs
    ours: Any = envs.unwrapped
    return Soaked(layer, steps, steps * ours.config.rates().ticks, lost, resets, *readings)


_HEAD = (
    *("Layer", "Steps", "Control ticks", "Lost", "Resets", "Memory (MB)", "Growth"),
    *("File descriptors", "Threads"),
)


def rows(found: list[Soaked]) -> list[str]:
    """Return the lines of the table."""
    lines = []
    for one in found:
        growth = f"{100 * one.growth:+.2f} %{'' if one.held else ' (missed)'}"
        cells = [f"`{one.layer}`", f"{one.steps:,}", f"{one.ticks:,}", str(one.lost)]
        cells += [f"{one.resets:,}", f"{one.last.memory / 2**20:.0f}", growth]
        held = (one.first.files, one.last.files), (one.first.threads, one.last.threads)
        lines.append([*cells, *(f"{first} → {last}" for first, last in held)])
    return markdown_table(_HEAD, lines).splitlines()


def main(config: SoakConfig) -> int:
    """Run, print, write."""
    check_positive(steps=config.steps, num_envs=config.num_envs, num_threads=config.num_threads)
    if config.write_docs:
        spliced(RELIABILITY_PAGE, "", "soak")  # to know before the work that it can be written
    began, found = time.monotonic(), []
    for layer in config.layers:
        found.append(soak(config, layer))
        print("\n".join(rows(found)[0 if len(found) == 1 else -1 :]), flush=True)
    minutes = (time.monotonic() - began) / 60.0
    total = sum(one.steps for one in found)
    head = (
        f"{total:,} environment steps of `{config.env}` on {count(config.num_threads, 'thread')}, "
        f"{config.num_envs} robots side by side, in {minutes:.1f} minutes.\n\n"
    )
    if config.write_docs:
        splice(RELIABILITY_PAGE, head + "\n".join(rows(found)), "soak")
    return 0 if all(one.held for one in found) else 1


if __name__ == "__main__":
    sys.exit(run_command("eval.tools.soak", SoakConfig, main))
