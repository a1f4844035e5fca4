"""Forces on the feet from what the motors give, for robots without sensors in their feet.

The rows of M vdot + h + damping = tau + J^T f that belong to a leg's joints hold the force f on its
foot. Accelerations are differences of measured velocities over a tick; f is the least squares
solution, slightly damped, as legs that are stretched tell little. A low pass takes out most of the
noise of those differences.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.quantities import DynamicsTerms
from fbid_gym.small_matrices import factor, solve_factored

_DAMPED = 1e-3  # of the mean square of the Jacobian's entries
_TIME = 0.01  # s, of the low pass


class TorqueSense(NamedTuple):
    """Constants of a robot with n joints and F feet."""

    joint: np.ndarray  # (F, K) int64, joints of each foot's leg; -1 beyond the last
    rows: int  # 3 of a foot's Jacobian for points, 6 for soles
    damping: np.ndarray  # (n,) N·m·s/rad
    tick: float  # s
    follow: float  # share of the way to the newest force in a tick

    @classmethod
    def of(cls, joint: np.ndarray, soles: bool, damping: np.ndarray, tick: float) -> "TorqueSense":
        """Return those of a robot at its control's tick, s."""
        follow = 1.0 - float(np.exp(-tick / _TIME))
        return cls(joint, 6 if soles else 3, damping.astype(float), tick, follow)


class Felt(NamedTuple):
    """Measured torques and motion of N robots at a tick."""

    terms: DynamicsTerms  # at its beginning, as they believe
    torque: np.ndarray  # (N, n) N·m, of the motors in it
    before: np.ndarray  # (N, nv) velocities at its beginning, as measured
    after: np.ndarray  # (N, nv) at its end


@kernel
def find_loads(own: TorqueSense, felt: Felt, load: np.ndarray) -> None:
    """Find the vertical forces on the feet of N robots over a tick: `load` (N, F) N is updated."""
    matrix, force = np.empty((own.rows, own.rows)), np.empty(own.rows)
    rest = np.empty(felt.torque.shape[1])
    for i in range(len(load)):
        _find(own, felt, load, matrix, force, rest, i)


@compiled
def _find(
    own: TorqueSense,
    felt: Felt,
    load: np.ndarray,
    matrix: np.ndarray,
    force: np.ndarray,
    rest: np.ndarray,
    i: int,
) -> None:
    """Find those of one robot; `matrix`, `force` and `rest` are buffers."""
    terms, torque, before, after = felt
    size, joints = before.shape[1], len(rest)
    for j in range(joints):
        total = terms.bias[i, 6 + j] - torque[i, j] + own.damping[j] * after[i, 6 + j]
        for k in range(size):
            total += terms.mass_matrix[i, 6 + j, k] * (after[i, k] - before[i, k]) / own.tick
        rest[j] = total
    for foot in range(load.shape[1]):
        square = 0.0
        for a in range(own.rows):
            force[a] = 0.0
            for b in range(own.rows):
                matrix[a, b] = 0.0
        for one in range(own.joint.shape[1]):
            joint = own.joint[foot, one]
            if joint >= 0:
                for a in range(own.rows):
                    entry = terms.foot_jacobian[i, foot, a, 6 + joint]
                    force[a] += entry * rest[joint]
                    square += entry * entry
                    for b in range(own.rows):
                        matrix[a, b] += entry * terms.foot_jacobian[i, foot, b, 6 + joint]
        for a in range(own.rows):
            matrix[a, a] += _DAMPED * square / own.rows + 1e-9
        factor(matrix)
        solve_factored(matrix, force)
        load[i, foot] += own.follow * (force[2] - load[i, foot])
