"""What a robot needs to stand and walk at all; the laws alone do not need it."""

import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.feet import contacts
from fbid_gym.robots.robot import Robot


def check_upright(robot: Robot) -> None:
    """Check that a robot has joints to act with, and that gravity pulls it onto its feet.

    Raises:
        RobotError: it has none, gravity does not pull down, or the robot is not above its feet.
    """
    if not robot.num_joints:
        raise RobotError(f"Robot {robot.name!r} has no joints to act with.")
    gravity = robot.model.opt.gravity
    if np.any(gravity[:2] != 0.0) or not -np.inf < gravity[2] < 0.0:
        given = " ".join(f"{value:g}" for value in gravity)
        raise RobotError(f'gravity="{given}" does not pull down. Expected "0 0 -9.81" or the like.')
    home = robot.at_home
    above = home.com[2] - contacts(robot.feet, home.data)[:, 2].mean()
    if above <= 0.0:
        raise RobotError(
            f"The centre of mass of {robot.name!r} is {-1e3 * above:.3g} mm below its feet at "
            "home. Expected a robot that stands on them: give home=."
        )
