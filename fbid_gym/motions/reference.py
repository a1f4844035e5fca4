"""What a robot shall do at one instant: the common ground of tasks, layers and experiments."""

from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.support import Support
from fbid_gym.robots import Robot


class Reference(NamedTuple):
    """The motion that N robots shall follow, at one control tick; nv = 6 + n, F feet.

    The base is seen from the reference's own feet: the origin is the centre of the contact points
    at this instant, z points up, and x is the feet's forward direction, the support frame
    (`Support.frame`) of the reference posture. Velocities and accelerations are those of a
    motion whose planted feet stand still in the world, expressed along the axes of that frame: the
    base's linear part is not relative to the moving centre of the feet.

    Attributes:
        qpos: (N, nq) m, unit quaternion wxyz, rad.
        qvel: (N, nv) m/s, rad/s; the angular part in the base's frame.
        qacc: (N, nv) m/s^2, rad/s^2, rate of qvel.
        planted: (N, F) bool, which feet are planned to stand; None for all of them.
    """

    qpos: np.ndarray
    qvel: np.ndarray
    qacc: np.ndarray
    planted: np.ndarray | None


def home_reference(robot: Robot, num_robots: int) -> Reference:
    """Return the reference of robots that hold their home stance."""
    qpos = robot.home_qpos.copy()
    qpos[:3] = Support.of(robot).home_base
    rest = np.zeros((num_robots, robot.nv))
    return Reference(np.tile(qpos, (num_robots, 1)), rest, rest.copy(), None)
