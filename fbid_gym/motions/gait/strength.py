"""What the joints of a robot on two soles can do: how quickly its legs swing, how far they bend.

A foot that goes two strides v T by the quintic of `swing.rise`, in the share s of the step's time
T that it is in the air, is accelerated by up to 5.77 * 2 v / (s^2 T). The joints have to be strong
enough for that, and knees to carry the robot on a bent leg.
"""

import math

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.robots import Robot

_KNEES = 1.0  # of a joint's torque, to carry the robot on one leg


def swing_time(robot: Robot, velocity: float, share: float) -> float:
    """Return the shortest time of a step, s, in which every leg swings as the velocity asks.

    Args:
        robot: on two soles.
        velocity: m/s ahead.
        share: of the step that a foot is in the air.
    """
    stance, limits = Stance.of(robot), robot.torque_limit
    matrix, worst = stance.terms.mass_matrix[0], 0.0
    for foot, moves in enumerate(stance.legs):
        joints = np.flatnonzero(moves)
        rows = 6 + joints
        jacobian = stance.terms.foot_jacobian[0, foot][:, rows]
        # Per m/s^2 of the foot ahead, its rotation kept.
        ahead = np.linalg.pinv(jacobian, rcond=1e-6)[:, 0]
        worst = max(worst, np.max(np.abs(matrix[np.ix_(rows, rows)] @ ahead) / limits[joints]))
    return 5.77 * 2.0 * velocity / share**2 * float(worst)


def deepest_bend(robot: Robot) -> float:
    """Return by how much a robot on two soles can be lower than at home, m, as knees carry it."""
    stance, bends = Stance.of(robot), [math.inf]
    leg = stance.size
    for foot, moves in enumerate(stance.legs):
        joints = np.flatnonzero(moves)
        # The knee is the joint that makes the leg longer. With both parts of a leg alike, its lever
        # r and the distance D of the leg's ends keep r^2 + D^2 / 4.
        along = stance.hips[foot] - stance.terms.foot_position[0, foot]
        jacobian = stance.terms.foot_jacobian[0, foot][:3, 6 + joints]
        levers = np.abs(along / np.linalg.norm(along) @ jacobian)
        knee = int(np.argmax(levers))
        most = _KNEES * robot.torque_limit[joints[knee]] / robot.weight
        spare = most**2 - levers[knee] ** 2
        bends.append(leg * (1.0 - math.sqrt(max(1.0 - 4.0 * spare / leg**2, 0.0))))
    return min(bends)
