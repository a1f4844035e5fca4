"""The step from an action layer to MuJoCo at every control tick, compiled.

MuJoCo's batch keeps what it simulates in one row per robot: positions, velocities, controls and
applied forces, each from a column of its own on. The kernels read and write these rows.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.quantities import RobotState
from fbid_gym.runtime.effort import Effort, add_power


class Wiring(NamedTuple):
    """Places of a robot's quantities in the batch."""

    rows: np.ndarray  # (N, S) of the batch, live
    sensors: np.ndarray  # (N, R) of the batch, live
    warning: np.ndarray  # (N, W, 2) of the batch, live; the count of each kind comes second
    position: int  # first column of qpos in the rows
    velocity: int  # first column of qvel
    push: int  # first of the three columns of the force on the base
    controls: np.ndarray  # (n,) column of each joint's control
    contact: int  # first column of the contact forces among the sensors
    gear: np.ndarray  # (n,) torque per unit of control


@kernel
def read(wiring: Wiring, effort: Effort, state: RobotState) -> None:
    """Read what a control tick did to N robots; updates their state, and the effort's power."""
    rows = wiring.rows
    for i in range(len(rows)):
        for j in range(state.qpos.shape[1]):
            state.qpos[i, j] = rows[i, wiring.position + j]
        for j in range(state.qvel.shape[1]):
            state.qvel[i, j] = rows[i, wiring.velocity + j]
        for j in range(state.contact_force.shape[1]):
            for axis in range(3):
                column = wiring.contact + 3 * j + axis
                state.contact_force[i, j, axis] = wiring.sensors[i, column]
        state.tick[i] += 1
    add_power(effort, state.qvel)


@kernel
def find_diverged(wiring: Wiring, kinds: np.ndarray, size: int, fastest: float) -> np.ndarray:
    """Return which robots' states can no longer be trusted: (N,) bool.

    MuJoCo restarted them, as warnings of these kinds (K,) say, which were set to 1 beforehand, or
    one of their `size` = nv speeds is not below the fastest that is trusted, m/s and rad/s.
    """
    diverged = np.empty(len(wiring.rows), np.bool_)
    for i in range(len(wiring.rows)):
        trusted = True
        for kind in kinds:
            trusted &= wiring.warning[i, kind, 1] == 1
        for j in range(size):
            trusted &= abs(wiring.rows[i, wiring.velocity + j]) < fastest
        diverged[i] = not trusted
    return diverged
