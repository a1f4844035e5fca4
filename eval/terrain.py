"""How robots get over rough ground by a zero action: `python -m eval.terrain`.

Every layer meets the same ground, starts and commands, blind and with a scan of the ground.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, NamedTuple

import numpy as np
import tyro

from eval.pages import TERRAIN_PAGE, command_block, tell_rows
from eval.walking import Seconds, ready
from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.chunks import NUM_ENVS
from fbid_gym.envs.config import EnvConfig
from fbid_gym.options import Choice, Each, Number, check_fields
from fbid_gym.robots.terrain import LEVELLED
from train.command import run_command
from train.runs.robots import chosen

WALKING = [env for env, given in ENVIRONMENTS.items() if given["task"] == "walk"]


@dataclass(frozen=True)
class TerrainConfig:
    """Walk over every kind of ground without a policy, and tell how many stay up."""

    envs: Annotated[tuple[str, ...], Each(Choice(WALKING, "environment"))] = (
        "fbid_gym/QuadrupedTerrain-v0",
        "fbid_gym/BipedTerrain-v0",
    )
    """Environments."""
    robot: str | None = None
    """A robot instead of the environments' own: a built-in one, or your own file."""
    feet: tuple[str, ...] = ()
    """Its feet, as `eval.rollout` takes them, where the file does not say."""
    layers: Annotated[tuple[str, ...], Each(Choice(LAYERS, "action layer"))] = (
        "base_acceleration",
        "com_wrench",
        "joint_position",
    )
    """Action layers."""
    terrains: Annotated[tuple[str, ...], Each(Choice(LEVELLED, "terrain"))] = LEVELLED
    """Kinds of ground."""
    difficulties: Annotated[tuple[float, ...], Each(Number(0.0, 1.0))] = (0.0, 0.25, 0.5, 0.75, 1.0)
    """From 0 to 1."""
    scans: tuple[bool, ...] = (False, True)
    """Whether the robot sees the ground."""
    robots: Annotated[int, NUM_ENVS] = 32
    """How many walk side by side, robot i with seed i."""
    seconds: Seconds = 20.0
    """Length of an episode."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Put the table into docs/terrain.md."""


class Row(NamedTuple):
    """A row of the table: who walks on what."""

    env: str
    layer: str
    scan: bool
    terrain: str


class Walked(NamedTuple):
    """How it went.

    Attributes:
        survived: share of the robots that did not fall.
        error: m/s, mean error of velocity of those that walk.
    """

    survived: float
    error: float


def walk(row: Row, difficulty: float, config: TerrainConfig) -> Walked:
    """Let robots walk by a zero action, each for one episode."""
    robots, robot = config.robots, chosen(config.robot, config.feet)
    arguments = {
        **({} if robot is None else {"robot": robot}),
        "action_layer": row.layer,
        "terrain": row.terrain,
        "difficulty": difficulty,
        "height_scan": row.scan,
        "episode_seconds": config.seconds,
    }
    batch = ready(ENVIRONMENTS[row.env] | arguments, robots)
    action = np.zeros((robots, len(batch.action_names)))
    walking, fell = np.ones(robots, bool), np.zeros(robots, bool)
    errors, steps = 0.0, 0
    while walking.any():
        step = batch.step(action)
        errors += float(step.info["velocity_error"][walking].sum())
        steps += int(walking.sum())
        fell |= walking & step.terminated
        walking &= ~(step.terminated | step.truncated)
    return Walked(1.0 - float(fell.mean()), errors / steps)


def trials(config: TerrainConfig) -> Iterator[Row]:
    """Yield who walks on what, in the order of the table."""
    for env in config.envs:
        for layer in config.layers:
            for scan in config.scans:
                for terrain in config.terrains:
                    yield Row(env, layer, scan, terrain)


def rows(config: TerrainConfig) -> Iterator[str]:
    """Yield the lines of the table, each when it is there."""
    heads = ["environment", "layer", "ground", "terrain"]
    heads += [f"difficulty {difficulty:g}" for difficulty in config.difficulties]
    yield f"| {' | '.join(heads)} |"
    yield f"|{' --- |' * len(heads)}"
    for row in trials(config):
        yield line(row, [walk(row, difficulty, config) for difficulty in config.difficulties])


def line(row: Row, walked: list[Walked]) -> str:
    """Return a row of the table."""
    seen = "sees" if row.scan else "blind"
    cells = [row.env.removeprefix("fbid_gym/"), row.layer, seen, row.terrain]
    cells += [f"{100 * each.survived:.0f} %, {each.error:.2f}" for each in walked]
    return "| " + " | ".join(cells) + " |"


def said(config: TerrainConfig, command: Sequence[str]) -> str:
    """Say of what the table is: how many, how long, on which robots, under which pushes."""
    robot, pushed = chosen(config.robot, config.feet), []
    for env in config.envs:
        its = EnvConfig.of(ENVIRONMENTS[env] | ({} if robot is None else {"robot": robot}))
        least, most = its.resolved()["push_force"]
        pushes = f"pushes of {least:.0f} to {most:.0f} N" if most else "no pushes"
        pushed.append(f"{env.removeprefix('fbid_gym/')} with {its.load_robot().name}: {pushes}")
    return (
        f"{config.robots} robots each, {config.seconds:g} s. {'; '.join(pushed)}. By\n\n"
        f"{command_block(command)}"
    )


def run(config: TerrainConfig, command: Sequence[str]) -> None:
    """Walk, print the table and write it where asked to; what can be refused is refused before."""
    check_fields(config)
    tell_rows(rows(config), said(config, command), TERRAIN_PAGE if config.write_docs else None)


def main(argv: list[str] | None = None) -> int:
    """Command line."""
    given = sys.argv[1:] if argv is None else argv
    work = partial(run, command=["python", "-m", "eval.terrain", *given])
    return run_command("eval.terrain", TerrainConfig, work, given, __doc__)


if __name__ == "__main__":
    sys.exit(main())
