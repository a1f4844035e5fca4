"""A target that follows a policy's steps smoothly enough to have a rate and an acceleration."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.quantities import Memory


class Offset(NamedTuple):
    """Where the target of N robots is; n coordinates.

    Attributes:
        value: (N, n).
        rate: (N, n) per s.
        acceleration: (N, n) per s^2.
    """

    value: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True)
class SmoothTarget:
    """Critically damped second-order response to a goal u that is held for a control tick.

    xdd = w^2 (u - x) - 2 w xdot, solved exactly: with e = x - u and c = xdot + w e at a tick, the
    time t later x = u + (e + c t) exp(-w t) and xdot = (xdot - w c t) exp(-w t).

    Attributes:
        omega: w, rad/s.
        tick: s, of the control.
    """

    omega: float
    tick: float

    def memory(self, num_robots: int, size: int) -> Memory:
        """Return targets that rest at zero."""
        return {name: np.zeros((num_robots, size)) for name in ("target", "target_rate")}

    def step(self, goal: np.ndarray, memory: Memory) -> Offset:
        """Return where the target is at this tick, and move it on to the next.

        Args:
            goal: (N, n) u.
            memory: of the robots; updated.
        """
        offset = Offset(memory["target"], memory["target_rate"], np.empty(goal.shape))
        memory["target"], memory["target_rate"] = _follow(goal, self.omega, self.tick, offset)
        return offset


class _Next(NamedTuple):
    value: np.ndarray
    rate: np.ndarray


@kernel
def _follow(goal: np.ndarray, omega: float, tick: float, offset: Offset) -> _Next:
    """Write the acceleration of targets (N, n); return their values and rates a tick later."""
    value_after, rate_after = np.empty(goal.shape), np.empty(goal.shape)
    decay = np.exp(-omega * tick)
    for i in range(len(goal)):
        for j in range(goal.shape[1]):
            error = offset.value[i, j] - goal[i, j]
            slope = offset.rate[i, j] + omega * error
            travel = slope * tick
            offset.acceleration[i, j] = -omega * (slope + offset.rate[i, j])
            value_after[i, j] = goal[i, j] + (error + travel) * decay
            rate_after[i, j] = (offset.rate[i, j] - omega * travel) * decay
    return _Next(value_after, rate_after)
