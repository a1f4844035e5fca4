"""One robot of a batch at one moment, as its layer sees it."""

from dataclasses import dataclass

import numpy as np

from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target


@dataclass(frozen=True, eq=False)
class Moment:
    """What a layer would see of one robot if it were asked now; each in one row.

    All are copies: whoever computes with them changes no robot.

    Attributes:
        action: (1, A) of the layer, the one that held last; zeros before the first.
        state: of the robot.
        target: what the task asks for.
        terms: of the controller's model.
        actual: of the robot itself.
        memory: of the layer.
        acceleration: (3,) m/s^2, of the centre of mass in the last policy step, on average; NaN
            before the first.
    """

    action: np.ndarray
    state: RobotState
    target: Target
    terms: DynamicsTerms
    actual: DynamicsTerms
    memory: Memory
    acceleration: np.ndarray
