"""What a policy step did, for observation and reward."""

from typing import NamedTuple

import numpy as np

from fbid_gym.quantities import DynamicsTerms, RobotState


class Posture(NamedTuple):
    """How N robots stand; P points.

    Attributes:
        base: (N, 3) m, where each base is in its support frame.
        velocity: (N, 3) m/s, of the base along the axes of that frame.
        upright: (N,) cosine of the angle between the base's up direction and the vertical. The
            base's up direction is that which points up at home.
        touching: (N, P) bool, which points carry weight.
        slip: (N,) m/s, mean speed of the points on the ground.
    """

    base: np.ndarray
    velocity: np.ndarray
    upright: np.ndarray
    touching: np.ndarray
    slip: np.ndarray


class Outcome(NamedTuple):
    """What one policy step did to N robots.

    Attributes:
        state: at the end of the step.
        terms: dynamics at the end of the step.
        posture: at the end of the step.
        torque: (N, n) N·m, on the last control tick.
        torque_square: (N,) mean of torque^2 over the joints and ticks of the step.
        power: (N,) W, mean over the ticks of the joints' summed |torque * velocity|.
        seconds: s, length of the step.
    """

    state: RobotState
    terms: DynamicsTerms
    posture: Posture
    torque: np.ndarray
    torque_square: np.ndarray
    power: np.ndarray
    seconds: float
