"""What a policy step did, for observation and reward."""

from typing import NamedTuple

import numpy as np

from fbid_gym.quantities import DynamicsTerms, RobotState, SupportFrame


class Outcome(NamedTuple):
    """What one policy step did to N robots.

    Attributes:
        state: at the end of the step.
        terms: dynamics at the end of the step.
        frame: of the feet at the end of the step.
        torque: (N, n) N·m, on the last control tick.
        torque_square: (N,) mean of torque^2 over the joints and ticks of the step.
        power: (N,) W, mean over the ticks of the joints' summed |torque * velocity|.
        seconds: s, length of the step.
    """

    state: RobotState
    terms: DynamicsTerms
    frame: SupportFrame
    torque: np.ndarray
    torque_square: np.ndarray
    power: np.ndarray
    seconds: float
