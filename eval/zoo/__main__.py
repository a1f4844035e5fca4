"""How robots that nobody has seen stand and walk by a zero action: `python -m eval.zoo`.

Legs, joints, feet, actuators and masses are drawn from a seed, see `eval.zoo.morphology`.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
import tyro

from eval.pages import ZOO_PAGE, tell_rows
from eval.walking import Seconds, Trial, WalkingConfig, gaits, ready, walk
from eval.zoo import morphology
from eval.zoo.morphology import Morphology
from fbid_gym.actions import LAYERS
from fbid_gym.envs.chunks import NUM_ENVS
from fbid_gym.errors import RobotError
from fbid_gym.options import Choice, Each, Whole, check_fields
from fbid_gym.robots import Robot
from train.command import run_command


@dataclass(frozen=True)
class ZooConfig:
    """Let robots that nobody has seen stand and walk without a policy."""

    seeds: Annotated[tuple[int, ...], Each(Whole(0, 2**32 - 1))] = tuple(range(24))
    """Which robots are drawn."""
    layers: Annotated[tuple[str, ...], Each(Choice(LAYERS, "action layer"))] = tuple(LAYERS)
    """Action layers."""
    episodes: Annotated[int, NUM_ENVS] = 8
    """Robots side by side, environment i with seed i."""
    seconds: Seconds = 5.0
    """Length of an episode."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Put the table into docs/zoo.md."""


class Stood(NamedTuple):
    """How robots stood.

    Attributes:
        survival: share that did not fall.
        reward: mean of a policy step until then, at most 1.
    """

    survival: float
    reward: float


def built(animal: Morphology) -> Robot:
    """Return a drawn robot, loaded as a user would."""
    limit = morphology.torque_limit(animal) if animal.actuators == "none" else None
    return Robot.from_mjcf(morphology.mjcf(animal), animal.foot_names, torque_limit=limit)


def stand(robot: Robot, layer: str, episodes: int, seconds: float) -> Stood:
    """Let robots stand on a zero action, without pushes."""
    arguments = {
        "robot": robot,
        "task": "balance",
        "action_layer": layer,
        "episode_seconds": seconds,
        "push_force": (0.0, 0.0),
    }
    batch = ready(arguments, episodes)
    zero, up = np.zeros((episodes, len(batch.action_names))), np.ones(episodes, bool)
    rewards = []
    for _ in range(batch.num_steps):
        step = batch.step(zero)
        up = up & ~step.terminated
        rewards.append(step.reward[up])
    earned = np.concatenate(rewards)
    return Stood(float(up.mean()), float(earned.mean()) if earned.size else np.nan)


def rows(config: ZooConfig) -> Iterator[str]:
    """Yield the lines of the table, each when it is there: who, and how it stands and walks."""
    head = ["Seed", "Robot", *(f"`{layer}`" for layer in config.layers)]
    yield f"| {' | '.join(head)} |"
    yield f"|{' --- |' * len(head)}"
    for seed in config.seeds:
        animal = morphology.draw(seed)
        robot = built(animal)
        cells = [_figures(robot, layer, config) for layer in config.layers]
        yield f"| {' | '.join([str(seed), _in_words(animal, robot), *cells])} |"


def _figures(robot: Robot, layer: str, config: ZooConfig) -> str:
    stood = stand(robot, layer, config.episodes, config.seconds)
    said = f"{round(stood.survival * config.episodes)}, {stood.reward:.2f}"
    try:
        gait, *_ = gaits(robot)
    except RobotError:  # its feet have none
        return said
    walking = WalkingConfig(episodes=config.episodes, seconds=config.seconds)
    walked = walk(Trial(robot, gait, layer), walking)
    return f"{said}; {round(walked.survival * config.episodes)}, {walked.velocity_error:.2f}"


def _in_words(animal: Morphology, robot: Robot) -> str:
    return (
        f"{robot.mass:.3g} kg, {animal.legs} legs of {animal.leg:.2g} m, {animal.joints} joints, "
        f"{animal.foot} feet"
    )


def run(config: ZooConfig) -> None:
    """Stand, walk, print, write; what can be refused is refused before."""
    check_fields(config)
    said = f"{config.episodes} robots each, {config.seconds:g} s, no pushes."
    tell_rows(rows(config), said, ZOO_PAGE if config.write_docs else None)


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    return run_command("eval.zoo", ZooConfig, run, arguments)


if __name__ == "__main__":
    sys.exit(main())
