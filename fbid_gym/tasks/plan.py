"""The plan: all random parts of an episode, among them its start and the pushes on the base."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Number, Pair, check_fields
from fbid_gym.robots import Robot

MOST_EVENTS = 100_000
"""Pushes, or commands, in one episode; all of them are drawn as it begins."""

Plan = dict[str, np.ndarray]
"""All that chance decided about the episodes of N robots, one row each: see `Task.draw`."""


def drawn_commands(
    rng: np.random.Generator, interval: tuple[float, float], seconds: float, hz: int
) -> tuple[int, Plan]:
    """Draw when the commands of an episode begin.

    From one to the next it takes (least, most) s.

    Returns:
        K, how many commands there are, and "command_start": (K,) control ticks, the first at 0.
    """
    count = int(np.ceil(seconds / interval[0])) + 1
    times = np.cumsum(rng.uniform(*interval, size=count))
    return count, {"command_start": np.concatenate([[0.0], times[:-1]]) * hz}


@kernel
def command_at(
    start: np.ndarray, ramp: np.ndarray, command: np.ndarray, tick: np.ndarray
) -> np.ndarray:
    """Return the commands of N robots.

    Args:
        start: (N, K) control ticks at which commands begin.
        ramp: (N, K) control ticks that each takes to come evenly from the one before; 0: none.
        command: (N, K, C).
        tick: (N,) control ticks since the episode began.

    Returns:
        (N, C).
    """
    axes = command.shape[2]
    found = np.empty((len(tick), axes))
    for i in range(len(tick)):
        index = last_started(start[i], tick[i])
        left = 1.0 - (tick[i] - start[i, index]) / max(ramp[i, index], 1.0)
        for axis in range(axes):
            found[i, axis] = command[i, index, axis]
            if left > 0.0 and ramp[i, index] > 0.0:
                before = command[i, max(index - 1, 0), axis]
                found[i, axis] += left * (before - found[i, axis])
    return found


@compiled
def last_started(start: np.ndarray, tick: int) -> int:
    """Return which of those that start at ticks (K,), in order, is the last to have started."""
    index = -1
    for k in range(len(start)):
        index += start[k] <= tick
    return index


def check_schedule(name: str, interval: tuple[float, float], seconds: float) -> None:
    """Raise InvalidValueError where an episode of `seconds` has more events than are drawn.

    The interval is (least, most) s from one event to the next.
    """
    least = seconds / MOST_EVENTS
    if interval[0] < least:
        expected = f"at least {least:g} s at episode_seconds = {seconds:g}: an episode has room for"
        raise InvalidValueError(name, interval, f"{expected} {MOST_EVENTS:,} of them")


Force = Annotated[tuple[float, float], Pair(0.0, 1e6, "N")]
Jump = Annotated[tuple[float, float], Pair(0.0, 100.0, "m/s")]
Duration = Annotated[float, Number(1e-4, 1e6, "s")]
Interval = Annotated[tuple[float, float], Pair(1e-4, 1e9, "s")]

_NEVER = np.iinfo(np.int64).max // 2


@dataclass(frozen=True)
class Pushes:
    """Pushes at random times, each of a random strength in a random horizontal direction.

    The strength, uniform in [0, 1], says where between least and most both the force and the jump
    of velocity lie.

    Attributes:
        force: (least, most) N, constant while the push lasts. (0, 0) for none.
        duration: s.
        interval: (least, most) s from the start of one push (or of the episode) to the next.
        velocity: (least, most) m/s, by which the base's velocity jumps as a push begins.
    """

    force: Force
    duration: Duration
    interval: Interval
    velocity: Jump = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Refuse pushes that cannot be scheduled."""
        check_fields(self, "push_{}")
        if self.interval[0] < self.duration:
            raise InvalidValueError(
                "push_interval", self.interval, f"at least push_duration = {self.duration} s"
            )

    def draw(self, rng: np.random.Generator, seconds: float, hz: int) -> Plan:
        """Draw the pushes of one episode of `seconds` with `hz` control ticks per second.

        Returns:
            "push_start": (K,) control tick at which each begins; far beyond the episode if unused.
            "push_force": (K, 3) N, world.
            "push_velocity": (K, 3) m/s, world.
        """
        count = int(np.ceil(seconds / self.interval[0]))
        times = np.cumsum(rng.uniform(*self.interval, size=count))
        strength, angle = rng.random(count), rng.uniform(-np.pi, np.pi, size=count)
        direction = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        return {
            "push_start": np.where(times < seconds, np.round(times * hz).astype(np.int64), _NEVER),
            "push_force": _between(self.force, strength)[:, None] * direction,
            "push_velocity": _between(self.velocity, strength)[:, None] * direction,
        }

    def during(self, plan: Plan, tick: np.ndarray, count: int, hz: int) -> "Disturbances":
        """Return force and velocity jump of each base at `count` control ticks.

        The first of these is `tick` (N,), counted from the beginning of the episode.
        """
        pushed = plan["push_start"], plan["push_force"], plan["push_velocity"]
        return _during(*pushed, tick, count, round(self.duration * hz))


class Disturbances(NamedTuple):
    """Pushes on the bases of N robots at T control ticks."""

    force: np.ndarray  # (T, N, 3) N, world
    jump: np.ndarray  # (T, N, 3) m/s, world, by which velocities change before the tick
    jumping: np.ndarray  # (T,) bool, whether any does


def _between(ends: tuple[float, float], share: np.ndarray) -> np.ndarray:
    return ends[0] + (ends[1] - ends[0]) * share


@kernel
def _during(
    start: np.ndarray,
    force: np.ndarray,
    velocity: np.ndarray,
    tick: np.ndarray,
    count: int,
    duration: int,
) -> Disturbances:
    """Compute the result of `Pushes.during`, of pushes (N, K) that each last `duration` ticks."""
    shape = count, len(tick), 3
    done = Disturbances(np.zeros(shape), np.zeros(shape), np.zeros(count, np.bool_))
    for i in range(len(tick)):
        for k in range(start.shape[1]):
            for row in range(count):
                since = tick[i] + row - start[i, k]
                if since == 0:
                    for axis in range(3):
                        done.jump[row, i, axis] += velocity[i, k, axis]
                        done.jumping[row] |= velocity[i, k, axis] != 0.0
                if 0 <= since < duration:
                    for axis in range(3):
                        done.force[row, i, axis] += force[i, k, axis]
    return done


Noise = Annotated[float, Number(0.0, 1.0)]


@dataclass(frozen=True)
class Start:
    """Random offsets from the posture in which an episode begins.

    Attributes:
        joint_noise: rad (m for slides), largest offset of each joint.
        velocity_noise: m/s and rad/s, largest offset of each coordinate's velocity.
    """

    joint_noise: Noise = 0.02
    velocity_noise: Noise = 0.05

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_fields(self)

    def draw(
        self, robot: Robot, qpos: np.ndarray, qvel: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Draw a state with a random heading about a posture.

        Args:
            robot: whose state.
            qpos: (nq,) posture, the base seen along the axes of the feet. Where it stands, and how
                high, is for the simulation to settle, since that depends on the terrain.
            qvel: (nv,) its velocity, along the same axes.
            rng: of this episode.

        Returns:
            qpos (nq,) and qvel (nv,).
        """
        heading = rng.uniform(-np.pi, np.pi)
        qpos, qvel = qpos.copy(), qvel.copy()
        qpos[3:7] = _turned(heading, qpos[3:7])
        noise = rng.uniform(-self.joint_noise, self.joint_noise, size=robot.num_joints)
        qpos[7:] = np.clip(qpos[7:] + noise, robot.joint_range[:, 0], robot.joint_range[:, 1])
        cosine, sine = np.cos(heading), np.sin(heading)
        qvel[:2] = cosine * qvel[0] - sine * qvel[1], sine * qvel[0] + cosine * qvel[1]
        qvel += rng.uniform(-self.velocity_noise, self.velocity_noise, size=robot.nv)
        return qpos, qvel


def _turned(heading: float, quaternion: np.ndarray) -> np.ndarray:
    """Turn an orientation (w, x, y, z) about the world's vertical by `heading` rad."""
    cosine, sine = np.cos(heading / 2.0), np.sin(heading / 2.0)
    w, x, y, z = quaternion
    return np.array(
        [cosine * w - sine * z, cosine * x - sine * y, cosine * y + sine * x, cosine * z + sine * w]
    )
