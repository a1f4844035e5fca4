"""What motors did during a policy step."""

from typing import NamedTuple

import numpy as np


class Effort(NamedTuple):
    """What the motors of N robots did during a policy step; n joints."""

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
