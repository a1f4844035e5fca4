"""Effort of the motors during a policy step."""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import kernel


class Effort(NamedTuple):
    """Torque, power and energy of the motors of N robots during a policy step; n joints."""

    torque: np.ndarray  # (N, n) N·m, on the last control tick
    saturation: np.ndarray  # (N,) share of the joints at their limit, then
    torque_square: np.ndarray  # (N,) (N·m)^2, sum of torque^2 over joints and ticks
    lost: np.ndarray  # (N,) bool, robots whose torques were no numbers on some tick
    power: np.ndarray  # (N,) W, sum of |torque * velocity| over joints and ticks

    @classmethod
    def none(cls, num_robots: int, num_joints: int) -> "Effort":
        """At the beginning of a step."""
        saturation, torque_square, power = np.zeros((3, num_robots))
        torque, lost = np.zeros((num_robots, num_joints)), np.zeros(num_robots, bool)
        return cls(torque, saturation, torque_square, lost, power)

    def begin(self) -> None:
        """Begin another step: nothing has been added up."""
        self.torque_square[:], self.lost[:], self.power[:] = 0.0, False, 0.0


@kernel
def limit(effort: Effort, wanted: np.ndarray, most: np.ndarray) -> None:
    """Add torques (N, n) N·m of a control tick, limited to (n,) N·m in both directions.

    A robot whose torques are no numbers gets none, and is lost.
    """
    joints = len(most)
    for i in range(len(wanted)):
        broken = False
        for j in range(joints):
            broken |= np.isnan(wanted[i, j])
        full, square = 0, 0.0
        for j in range(joints):
            given = 0.0 if broken else min(max(wanted[i, j], -most[j]), most[j])
            full += abs(given) >= most[j]
            square += given * given
            effort.torque[i, j] = given
        effort.saturation[i] = full / joints
        effort.torque_square[i] += square
        effort.lost[i] |= broken


@kernel
def add_power(effort: Effort, qvel: np.ndarray) -> None:
    """Add to the power of N robots that of their torques at velocities (N, nv)."""
    for i in range(len(qvel)):
        total = 0.0
        for j in range(effort.torque.shape[1]):
            total += abs(effort.torque[i, j] * qvel[i, 6 + j])
        effort.power[i] += total
