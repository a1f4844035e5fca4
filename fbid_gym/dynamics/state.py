"""What is known of a batch of robots between two control ticks."""

from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.support import SupportFrame
from fbid_gym.dynamics.terms import DynamicsTerms


class RobotState(NamedTuple):
    """The state of N robots and what their sensors read; P contact points.

    Attributes:
        qpos: (N, nq) m, unit quaternion wxyz, rad.
        qvel: (N, nv) m/s, rad/s.
        contact_force: (N, P, 3) N, world, force of the ground on the robot at each point, during
            the last physics step.
        tick: (N,) control ticks since the episode began.
    """

    qpos: np.ndarray
    qvel: np.ndarray
    contact_force: np.ndarray
    tick: np.ndarray


class Outcome(NamedTuple):
    """What one policy step did to N robots, for observation and reward.

    Attributes:
        state: at the end of the step.
        terms: dynamics at the end of the step.
        frame: of the feet at the end of the step.
        torque: (N, n) N·m, on the last control tick.
        torque_square: (N,) mean of torque^2 over the joints and ticks of the step.
        power: (N,) W, mean over the ticks of the joints' summed |torque * velocity|.
    """

    state: RobotState
    terms: DynamicsTerms
    frame: SupportFrame
    torque: np.ndarray
    torque_square: np.ndarray
    power: np.ndarray
