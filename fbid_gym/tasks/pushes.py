"""Random horizontal pushes on the base: drawn once per episode, evaluated for a whole batch."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Number, Pair, check_fields
from fbid_gym.tasks.plan import Plan

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

        Args:
            plan: of N robots, as drawn.
            tick: (N,) the first, in control ticks since the episode began.
            count: T, how many.
            hz: control ticks per second.
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
