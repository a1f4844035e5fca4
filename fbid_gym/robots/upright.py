"""What a robot needs to stand and walk at all; the laws alone need it not."""

import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.mjcf import posed
from fbid_gym.robots.robot import Robot


def refuse_lying(robot: Robot) -> None:
    """Refuse a robot that has nothing to act with, or is not above its feet at home.

    Raises:
        RobotError: it is such a one.
    """
    if not robot.num_joints:
        raise RobotError(f"Robot {robot.name!r} has no joints to act with.")
    home = posed(robot.model, robot.home_qpos)
    feet = np.concatenate([foot.touching(home) for foot in robot.feet])
    above = home.subtree_com[robot.base_body, 2] - feet[:, 2].mean()
    if above <= 0.0:
        raise RobotError(
            f"The centre of mass of {robot.name!r} is {-1e3 * above:.3g} mm below its feet at "
            "home. Expected a robot that stands on them: give home=."
        )
