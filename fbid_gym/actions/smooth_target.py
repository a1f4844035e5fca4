"""A target that follows a policy's steps smoothly enough to have a rate and an acceleration."""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.quantities import Memory


class SmoothTarget(NamedTuple):
    """Critically damped second-order response to u = scale * action, held for a control tick.

    xdd = w^2 (u - x) - 2 w xdot, solved exactly: with e = x - u and c = xdot + w e at a tick, the
    time t later x = u + (e + c t) exp(-w t) and xdot = (xdot - w c t) exp(-w t).
    """

    scale: float  # u at action 1
    omega: float  # w, rad/s
    tick: float  # s, of the control


class TargetMemory(NamedTuple):
    """Where the targets of N robots are, n coordinates each; updated from tick to tick."""

    target: np.ndarray  # (N, n)
    target_rate: np.ndarray  # (N, n) per s

    @classmethod
    def of(cls, memory: Memory) -> "TargetMemory":
        """Return the target's part of a layer's memory, to be updated in place."""
        return cls(memory["target"], memory["target_rate"])

    @classmethod
    def fresh(cls, num_robots: int, size: int) -> "TargetMemory":
        """Return targets that rest at zero."""
        return cls(np.zeros((num_robots, size)), np.zeros((num_robots, size)))


class Offset(NamedTuple):
    """Where the targets of N robots are at a tick."""

    value: np.ndarray  # (N, n)
    rate: np.ndarray  # (N, n) per s
    acceleration: np.ndarray  # (N, n) per s^2


@kernel
def offset_of(smooth: SmoothTarget, action: np.ndarray, memory: TargetMemory) -> Offset:
    """Return where targets are at this tick, for actions (N, n)."""
    acceleration = np.empty(action.shape)
    for i in range(len(action)):
        for j in range(action.shape[1]):
            error = memory.target[i, j] - smooth.scale * action[i, j]
            twice = 2.0 * memory.target_rate[i, j] + smooth.omega * error
            acceleration[i, j] = -smooth.omega * twice
    return Offset(memory.target, memory.target_rate, acceleration)


@kernel
def move_on(smooth: SmoothTarget, action: np.ndarray, memory: TargetMemory) -> None:
    """Move targets on to the next tick, for actions (N, n); updates the memory."""
    omega, tick = smooth.omega, smooth.tick
    decay = np.exp(-omega * tick)
    for i in range(len(action)):
        for j in range(action.shape[1]):
            goal = smooth.scale * action[i, j]
            error, rate = memory.target[i, j] - goal, memory.target_rate[i, j]
            travel = (rate + omega * error) * tick
            memory.target[i, j] = goal + (error + travel) * decay
            memory.target_rate[i, j] = (rate - omega * travel) * decay
