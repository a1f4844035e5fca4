"""Policies and robots to choose from on the page: those of the command line, and ours."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from eval.play.controls import ALONE
from eval.play.stage import NO_POLICY
from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.fitting import sees_the_body
from fbid_gym.errors import InvalidValueError
from fbid_gym.policy import Policy, place_of, shipped
from fbid_gym.policy.policy_file import PREFIX
from fbid_gym.robots import ROBOTS, ZOO, Robot, load, several
from fbid_gym.robots.several import each_name
from fbid_gym.robots.zoo import FAMILIES, HELD_OUT
from fbid_gym.runtime.config import EnvConfig
from train.runs.environment import load_policy
from train.runs.robots import of_policy

_DRAWN = f"{HELD_OUT}-{HELD_OUT + 7}"  # seeds of those on the menu


class Entry(NamedTuple):
    """A policy that can be chosen."""

    name: str  # on the page
    policy: Policy  # what acts
    path: Path  # its run folder or file

    def robot(self) -> Robot:
        """Return the robot that it learnt with; FbidError for a user's own that is not there."""
        named = self.policy.env_args.get("robot")
        if isinstance(named, str):
            return load(named)
        own = EnvConfig.of(ENVIRONMENTS[self.policy.env_id]).load_robot()
        return of_policy(self.path, self.policy.env_args) or own


def named(sources: Sequence[Path]) -> list[Entry]:
    """Return the policies of a command line, by names of their own; FbidError for two of a name."""
    found: list[Entry] = []
    for source in sources:
        path = place_of(source)
        name = str(source) if str(source).startswith(PREFIX) else path.name or str(path)
        if name in (NO_POLICY, ALONE, *LAYERS, *(entry.name for entry in found)):
            expected = f"a policy alone of its name, not another {name!r}"
            raise InvalidValueError("--policy", str(source), expected)
        found.append(Entry(name, load_policy(path), path))
    return found


def of_package(env_id: str, robot: Robot) -> Iterator[Entry]:
    """Yield the policies that are shipped for an environment and a robot, or for any body."""
    for each in shipped():
        if each.policy.env_id == env_id:
            entry = Entry(PREFIX + each.name, load_policy(each.path), each.path)
            its = entry.robot()
            alike = sees_the_body(entry.policy) and its.num_feet == robot.num_feet
            if alike or its.digest == robot.digest:
                yield entry


def robots_beside(robot: Robot, named: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the names of robots that can be chosen: the one with which a session begins, others.

    These are named by the command line, or else built-in and drawn ones with as many feet.

    Raises:
        FbidError: a name that is none, or of a robot with more or fewer feet.
    """
    feet, found = robot.num_feet, list(each_name(named))
    for name, other in zip(found, several(found) if found else (), strict=True):
        if other.num_feet != feet:
            expected = f"robots with {feet} feet, as {robot.name} has; it has {other.num_feet}"
            raise InvalidValueError("--robots", name, expected)
    if not named:
        found = [name for name in ROBOTS if load(name).num_feet == feet]
        family = [name for name, legs in FAMILIES.items() if name and legs == feet]
        found += each_name([f"{ZOO}{name}:{_DRAWN}" for name in family])
    return tuple(dict.fromkeys([robot.name, *found]))


def robot_of(entries: Sequence[Entry]) -> Robot | None:
    """Return the robot that policies learnt with, None without any; FbidError for several."""
    robots = [entry.robot() for entry in entries]
    for entry, robot in zip(entries, robots, strict=True):
        if robot.digest != robots[0].digest:
            expected = f"a policy for robot {robots[0].name!r}, or --robot"
            raise InvalidValueError("--policy", str(entry.path), expected)
    return next(iter(robots), None)
