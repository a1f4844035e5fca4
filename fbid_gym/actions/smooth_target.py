"""A target that follows a policy's steps smoothly enough to have a rate and an acceleration."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.layer import Memory
from fbid_gym.compiled import kernel


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
        value, rate = memory["target"], memory["target_rate"]
        acceleration, after, rate_after = (np.empty(value.shape) for _ in range(3))
        _follow(goal, value, rate, self.omega, self.tick, acceleration, after, rate_after)
        memory["target"], memory["target_rate"] = after, rate_after
        return Offset(value, rate, acceleration)


@kernel
def _follow(
    goal: np.ndarray,
    value: np.ndarray,
    rate: np.ndarray,
    omega: float,
    tick: float,
    acceleration: np.ndarray,
    value_after: np.ndarray,
    rate_after: np.ndarray,
) -> None:
    """Write the acceleration of targets (N, n), and their values and rates a tick later."""
    decay = np.exp(-omega * tick)
    for i in range(len(value)):
        for j in range(value.shape[1]):
            error = value[i, j] - goal[i, j]
            slope = rate[i, j] + omega * error
            travel = slope * tick
            acceleration[i, j] = -omega * (slope + rate[i, j])
            value_after[i, j] = goal[i, j] + (error + travel) * decay
            rate_after[i, j] = (rate[i, j] - omega * travel) * decay
