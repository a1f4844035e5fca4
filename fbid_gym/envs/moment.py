"""One robot of a batch at one moment, as its layer sees it."""

from dataclasses import dataclass

import numpy as np

from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target


@dataclass(frozen=True, eq=False)
class Moment:
    """What a layer would see of one robot if it were asked now; each in one row.

    All are copies: whoever computes with them changes no robot.
    """

    action: np.ndarray  # (1, A) of the layer, the one that held last; zeros before the first
    state: RobotState  # of the robot
    target: Target  # what the task asks for
    terms: DynamicsTerms  # of the controller's model
    actual: DynamicsTerms  # of the robot itself
    memory: Memory  # of the layer
    # (3,) m/s^2, of the centre of mass in the last policy step, on average; NaN before the first.
    acceleration: np.ndarray
