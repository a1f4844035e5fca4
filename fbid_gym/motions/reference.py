"""What a robot shall do at one instant: the common ground of tasks, layers and experiments."""

from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.support import Support
from fbid_gym.robots import Robot


class Reference(NamedTuple):
    """The motion that N robots shall follow, at one control tick; nv = 6 + n, F feet.

    All arrays may have a single row, N = 1, that stands for all robots.

    The base is seen from the reference's own feet: the origin is the centre of the contact points
    at this instant, z points up, and x is the feet's forward direction, the support frame
    (`Support.frame`) of the reference posture. Velocities and accelerations are those of a
    motion whose planted feet stand still in the world, expressed along the axes of that frame: the
    base's linear part is not relative to the moving centre of the feet.

    Attributes:
        qpos: (N, nq) m, unit quaternion wxyz, rad.
        qvel: (N, nv) m/s, rad/s; the angular part in the base's frame.
        qacc: (N, nv) m/s^2, rad/s^2, rate of qvel.
        com: (N, 3) m, centre of mass.
        com_velocity: (N, 3) m/s.
        com_acceleration: (N, 3) m/s^2.
        planted: (N, F) bool, which feet are planned to stand; None for all of them.
    """

    qpos: np.ndarray
    qvel: np.ndarray
    qacc: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray
    com_acceleration: np.ndarray
    planted: np.ndarray | None


def home_reference(robot: Robot) -> Reference:
    """Return the reference of robots that hold their home stance, in a single row."""
    support = Support.of(robot)
    qpos = np.concatenate([support.home_base, robot.home_qpos[3:]])
    rest, still = np.zeros((1, robot.nv)), np.zeros((1, 3))
    return Reference(qpos[None], rest, rest, support.home_com[None], still, still, None)


def empty_parts(count: int, robot: Robot) -> tuple[np.ndarray, ...]:
    """Return the seven arrays of a `Reference` of N robots, not filled in yet."""
    coordinates = ((count, robot.nq), (count, robot.nv), (count, robot.nv))
    parts = [np.empty(shape) for shape in (*coordinates, *[(count, 3)] * 3)]
    return *parts, np.empty((count, robot.num_feet), bool)
