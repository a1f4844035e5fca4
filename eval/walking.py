"""How robots walk by a zero action, by every layer and every gait: `python -m eval.walking`.

All layers and gaits meet the same commands and pushes.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
import tyro

from eval.pages import WALKING_PAGE, tell_rows
from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.chunks import NUM_ENVS
from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.gait.gait import gait_of
from fbid_gym.motions.gait.schedule import PATTERNS
from fbid_gym.options import Choice, Each, Number, check_fields
from fbid_gym.robots import Robot
from train.command import run_command
from train.runs.robots import chosen

ROBOTS = ("go1", "quadruped", "biped", "humanoid", "g1")
"""What walks by default."""

_PATTERNS = tuple(gait for gait in PATTERNS if gait != "stand")


Seconds = Annotated[float, Number(0.02, 10_000.0, "s")]
Push = Annotated[float, Number(0.0, 1e6, "N")]


@dataclass(frozen=True)
class WalkingConfig:
    """Walk without a policy through every layer, and tell how well."""

    robots: tuple[str, ...] = ROBOTS
    """Built-in robots, or your own: paths as `--robot` of other commands takes them."""
    layers: Annotated[tuple[str, ...], Each(Choice(LAYERS, "action layer"))] = tuple(LAYERS)
    """Action layers."""
    episodes: Annotated[int, NUM_ENVS] = 32
    """Robots that walk side by side, environment i with seed i."""
    seconds: Seconds = 20.0
    """Length of an episode."""
    push: Push = 0.0
    """N, of pushes of 0.15 s every 1.5 to 3 s in a random direction."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Put the table into docs/walking.md."""


class Trial(NamedTuple):
    """What walks."""

    robot: Robot
    gait: str | None
    layer: str


class Walked(NamedTuple):
    """How it went; means over all robots and times until a robot falls.

    Attributes:
        survival: share of the robots that stayed up.
        velocity_error: m/s, horizontal, at every moment.
        mean_velocity_error: m/s, of the velocity averaged over each whole second.
        turning_error: rad/s.
        mean_turning_error: rad/s, averaged likewise.
        transport: cost of it, energy of the joints over weight times way.
    """

    survival: float
    velocity_error: float
    mean_velocity_error: float
    turning_error: float
    mean_turning_error: float
    transport: float


def trials(config: WalkingConfig) -> list[Trial]:
    """Return what walks, in the order of the table: first each robot by its first gait."""
    walks = [(robot, gait) for robot in loaded(config.robots) for gait in gaits(robot)]
    walks.sort(key=lambda one: one[1] not in (None, "trot"))
    return [Trial(robot, gait, layer) for robot, gait in walks for layer in config.layers]


def loaded(names: Sequence[str]) -> list[Robot]:
    """Load the robots that a command line names.

    Raises:
        FbidError: there are none, or one that cannot be used.
    """
    robots = [robot for name in names if (robot := chosen(name))]
    if not robots:
        raise InvalidValueError("robots", list(names), "one or more")
    return robots


def environment(robot: Robot) -> str:
    """Return the environment that a robot walks in: on two feet, or on more."""
    return f"fbid_gym/{'Biped' if robot.num_feet == 2 else 'Quadruped'}Walk-v0"


def gaits(robot: Robot) -> tuple[str | None, ...]:
    """Return the gaits of a robot; None for the only one.

    Raises:
        RobotError: it has none.
    """
    known = (None,) if robot.num_feet == 2 else _PATTERNS
    gait_of(robot, ENVIRONMENTS[environment(robot)]["control_hz"], known[0])
    return known


def walk(trial: Trial, config: WalkingConfig, **others: Any) -> Walked:
    """Walk, and measure; `others` are arguments of the environment that differ from its own."""
    arguments = ENVIRONMENTS[environment(trial.robot)] | {
        "robot": trial.robot,
        "gait": trial.gait,
        "action_layer": trial.layer,
        "episode_seconds": config.seconds,
        "push_force": (config.push, config.push),
        **others,
    }
    batch = ready(arguments, config.episodes)
    zero = np.zeros((config.episodes, len(batch.action_names)))
    names = list(batch.observation_names)
    seen = [names.index(f"base velocity {way} (m/s, heading)") for way in ("ahead", "to the left")]
    said = [names.index(f"commanded velocity {way} (m/s)") for way in ("ahead", "to the left")]
    turn = names.index("commanded yaw rate (rad/s)")
    up = np.ones(config.episodes, bool)
    found: dict[str, list[np.ndarray]] = {key: [] for key in ("up", "miss", "turn", "power", "way")}
    for _ in range(batch.num_steps):
        step = batch.step(zero)
        up = up & ~step.terminated
        found["up"].append(up)
        found["miss"].append(step.observation[:, seen] - step.observation[:, said])
        found["turn"].append(_spin(batch) - step.observation[:, turn])
        found["power"].append(step.info["power"])
        found["way"].append(step.info["speed"])
        if not up.any():
            break
    told = {key: np.array(value) for key, value in found.items()}
    return summarised(told, batch.rates.policy, batch.robot.weight)


def ready(arguments: Mapping[str, Any], count: int) -> EnvBatch:
    """Return environments at the start of an episode, environment i with seed i."""
    batch = EnvBatch(EnvConfig.of(arguments), count)
    for env in range(count):
        batch.seed(env, np.random.default_rng(env))
    batch.reset(np.arange(count))
    return batch


def _spin(batch: EnvBatch) -> np.ndarray:
    """Return how fast the bases turn about the vertical, (N,) rad/s to the left."""
    vertical = batch.simulation.terms().world_from_base[:, 2]
    return np.vecdot(vertical, batch.simulation.qvel[:, 3:6])


def summarised(told: dict[str, np.ndarray], hz: int, weight: float) -> Walked:
    """Return what the steps of T steps and N robots say.

    Args:
        told: "up" (T, N) bool, until a robot falls; "miss" (T, N, 2) m/s, velocity beyond that
            commanded; "turn" (T, N) rad/s, likewise; "power" (T, N) W; "way" (T, N) m/s.
        hz: steps per second.
        weight: N, of the robot.
    """
    up = told["up"]
    miss, turn = told["miss"], told["turn"]
    whole = len(up) // hz
    # A second counts if the robot is up at its end.
    lasting = up[hz - 1 :: hz][:whole]

    def by_second(values: np.ndarray) -> np.ndarray:
        return values[: whole * hz].reshape(whole, hz, *values.shape[1:]).mean(axis=1)[lasting]

    way = float(told["way"][up].sum())
    return Walked(
        survival=float(up[-1].mean()),
        velocity_error=_mean(np.linalg.norm(miss, axis=2)[up]),
        mean_velocity_error=_mean(np.linalg.norm(by_second(miss), axis=1)),
        turning_error=_mean(np.abs(turn)[up]),
        mean_turning_error=_mean(np.abs(by_second(turn))),
        transport=float(told["power"][up].sum()) / (weight * way) if way else np.nan,
    )


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if values.size else np.nan


_HEAD = ("Robot", "Gait", "Layer", "Up", "Velocity error (m/s)", "of 1 s means",
         "Yaw rate error (rad/s)", "of 1 s means", "Cost of transport")  # fmt: skip


def rows(config: WalkingConfig) -> Iterator[str]:
    """Yield the lines of the table, each when it is there."""
    yield f"| {' | '.join(_HEAD)} |"
    yield f"|{' --- |' * len(_HEAD)}"
    for trial in trials(config):
        walked = walk(trial, config)
        figures = [f"{value:.2f}" if np.isfinite(value) else "–" for value in walked[1:]]
        up = f"{round(walked.survival * config.episodes)} of {config.episodes}"
        cells = [trial.robot.name, trial.gait or "walk", f"`{trial.layer}`", up, *figures]
        yield f"| {' | '.join(cells)} |"


def run(config: WalkingConfig) -> None:
    """Walk, print, write; what can be refused is refused before."""
    check_fields(config)
    trials(config)
    said = f"{config.episodes} robots each, {config.seconds:g} s, pushes of {config.push:g} N."
    tell_rows(rows(config), said, WALKING_PAGE if config.write_docs else None)


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    return run_command("eval.walking", WalkingConfig, run, arguments)


if __name__ == "__main__":
    sys.exit(main())
