"""References that are not tables: robots that stay where they are, and rows to be filled in."""

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.quantities import Reference
from fbid_gym.robots import Robot


def home_reference(robot: Robot) -> Reference:
    """Return the reference of robots that hold their home stance, in a single row."""
    stance = Stance.of(robot)
    qpos = np.concatenate([stance.home_base, robot.home_qpos[3:]])
    rest, still = np.zeros((1, robot.nv)), np.zeros((1, 3))
    planted = np.ones((1, robot.num_feet), bool)
    return Reference(
        qpos[None], rest, rest, stance.home_com[None], still, still, planted, stepping=False
    )
