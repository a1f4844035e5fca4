"""A list of robots, as users write it."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fbid_gym.errors import InvalidValueError, UnknownOptionError
from fbid_gym.robots.built_in import ROBOTS, load
from fbid_gym.robots.robot import Robot
from fbid_gym.robots.source import MENAGERIE, is_published
from fbid_gym.robots.zoo import ZOO, drawn


def several(robots: Any) -> tuple[Robot, ...]:
    """Return the robots of a list, or raise FbidError for an empty one, or something else in it.

    Each is a `Robot`, the name of a built-in one, "menagerie:NAME", the path of a file, or
    "zoo:quadruped:0-63" for as many drawn ones, see `fbid_gym.robots.zoo`; or it is one of these.
    """
    listed = [robots] if isinstance(robots, str | Path | Robot) else robots
    if not isinstance(listed, Sequence) or not listed:
        raise InvalidValueError("robots", robots, "a list of at least one robot")
    return tuple(robot for given in listed for robot in _meant(given))


def each_name(robots: Sequence[str]) -> tuple[str, ...]:
    """Return the names of a list, one for each of the drawn robots that it stands for."""
    return tuple(n for name in robots for n in (drawn(name) if name.startswith(ZOO) else (name,)))


def _meant(given: Any) -> tuple[Robot, ...]:
    if isinstance(given, Robot):
        return (given,)
    if not isinstance(given, str | Path):
        raise InvalidValueError("robots", given, "names, paths of files, or Robots")
    name = str(given)
    if name.startswith(ZOO):
        return tuple(map(load, drawn(name)))
    if name in ROBOTS or name.startswith(MENAGERIE):
        return (load(name),)
    check_word(name)
    return (Robot.load(given),)


def check_word(name: str) -> None:
    """Raise UnknownOptionError for a word that is no path of a file, nor a published robot."""
    path = Path(name)
    if not (is_published(name) or path.suffix or path.name != name or os.path.exists(name)):
        raise UnknownOptionError("robot", name, (*ROBOTS, f"{ZOO}7", "the path of a file"))
