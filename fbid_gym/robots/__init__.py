"""What a robot is: model, feet and their contact points, limits, home pose."""

import functools
from collections.abc import Mapping
from typing import Any

from fbid_gym.errors import UnknownOptionError
from fbid_gym.robots import biped, g1, go1, humanoid, quadruped
from fbid_gym.robots.assets import asset_path
from fbid_gym.robots.feet import Foot
from fbid_gym.robots.robot import Robot

__all__ = ["ROBOTS", "Foot", "Robot", "load", "motor_sheet"]

_CONSTANTS = {
    "biped": biped,
    "quadruped": quadruped,
    "humanoid": humanoid,
    "go1": go1,
    "g1": g1,
}

ROBOTS = tuple(_CONSTANTS)
"""Names of the built-in robots."""


@functools.cache
def load(name: str) -> Robot:
    """Load a built-in robot; the same object every time.

    Raises:
        UnknownOptionError: no robot of this name.
    """
    if name not in _CONSTANTS:
        raise UnknownOptionError("robot", name, ROBOTS)
    constants = _CONSTANTS[name]
    return Robot.from_mjcf(
        asset_path(constants.ASSET), constants.FEET, name=name, home=constants.HOME
    )


def motor_sheet(robot: Robot) -> Mapping[str, Any] | None:
    """Return the table of a built-in robot's motors, see `fbid_gym.robots.drives`; None of others.

    A robot of the user's may have the name of a built-in one.
    """
    known = robot.name in _CONSTANTS and load(robot.name) is robot
    return _CONSTANTS[robot.name].MOTORS if known else None
