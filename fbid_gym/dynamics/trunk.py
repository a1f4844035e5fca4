"""The trunk's axes: ahead, to the left and up at home, however the base's own axes lie in it."""

import mujoco
import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.dynamics.vectors import Vector, matrix, transposed, turn, vector
from fbid_gym.quantities import DynamicsTerms
from fbid_gym.robots import Robot


def base_from_trunk(robot: Robot) -> np.ndarray:
    """Return the trunk's axes in those of the base: (3, 3).

    At home they are the world's, where the robot stands upright and faces along x.
    """
    rotation, quaternion = np.empty(9), robot.home_qpos[3:7]
    mujoco.mju_quat2Mat(rotation, quaternion / np.linalg.norm(quaternion))
    return rotation.reshape(3, 3).T.copy()


def about_base(robot: Robot, tilting: float, turning: float) -> np.ndarray:
    """Return what counts `turning` about the trunk's vertical and `tilting` about its other axes.

    (3,) about the base's axes: exact where they are the trunk's, in any order.
    """
    return np.square(base_from_trunk(robot)) @ np.array([tilting, tilting, turning])


@compiled
def trunk_rate(terms: DynamicsTerms, qvel: np.ndarray, i: int) -> Vector:
    """Return how fast the trunk of robot i turns, rad/s, about its own axes; qvel (N, nv)."""
    world = turn(matrix(terms.world_from_base, (i,)), vector(qvel, (i,), 3))
    return turn(transposed(matrix(terms.world_from_trunk, (i,))), world)
