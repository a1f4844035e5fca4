"""What a robot is: model, feet and their contact points, limits, home pose."""

import functools

from fbid_gym.errors import UnknownOptionError
from fbid_gym.robots import biped, g1, go1, humanoid, quadruped
from fbid_gym.robots.assets import asset_path
from fbid_gym.robots.feet import Foot
from fbid_gym.robots.robot import Robot
from fbid_gym.robots.source import MENAGERIE

__all__ = ["MENAGERIE", "ROBOTS", "Foot", "Robot", "load"]

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
    """Load a built-in robot, or "menagerie:NAME"; the same object every time.

    Raises:
        UnknownOptionError: no robot of this name.
        FbidError: as `Robot.load`.
    """
    if name.startswith(MENAGERIE):
        return Robot.load(name)
    if name not in _CONSTANTS:
        raise UnknownOptionError("robot", name, ROBOTS)
    constants = _CONSTANTS[name]
    return Robot.from_mjcf(
        asset_path(constants.ASSET), constants.FEET, name=name, home=constants.HOME
    )
