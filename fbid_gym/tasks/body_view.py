"""The part of an observation that means the same on every legged robot.

It concerns the body and the feet, none of the joints, in the robot's own units: h is the height of
its centre of mass at home, g gravity. So a robot that is larger, heavier and slower by the laws of
dynamic similarity sees the same numbers at the same motion.
"""

import re
from collections.abc import Sequence

import numpy as np

from fbid_gym.tasks.body import Body, Units
from fbid_gym.tasks.observation import FORCES, Group, Groups

_HEIGHT = Group(
    ("height of the base above the ground, from the gait's (m)",),
    10.0,
    lambda m: (m.motion.height - m.motion.height_command)[:, None],
)
"""Robots whose legs are straight at home walk lower, by as much as tells which robot it is."""

_UNIT = re.compile(r"\((m/s|rad/s|m)(,[^()]*)?\)$")
_OWN = {"m": "h", "m/s": "sqrt(g h)", "rad/s": "sqrt(g / h)"}


def own_units(body: Body) -> Units:
    """Return the units of the view."""
    return Units.of(body.robot, float(body.stance.home_com[2]))


def body_view(groups: Groups, body: Body) -> Groups:
    """Return a table of an observation without joints, in the robot's own units.

    Names do not depend on the robot: feet are numbered in the order of the robot's, which is that
    of their places, see `fbid_gym.robots.by_place`; so are places where the ground is seen.
    """
    robot, units = body.robot, own_units(body)
    found: dict[str, Group] = {}
    for name, group in groups.items():
        if _is_of_each(group, robot.joint_names):
            continue
        named = _HEIGHT if name == "height" else group
        if _is_of_each(group, robot.foot_names):
            rest = [n.removeprefix(f) for n, f in zip(group.names, robot.foot_names, strict=True)]
            named = group._replace(names=tuple(f"foot {k}{word}" for k, word in enumerate(rest)))
        elif name == "scan":
            seen = tuple(f"ground at place {k} of the scan (m)" for k in range(len(group.names)))
            named = group._replace(names=seen)
        found[name] = _foot_loads(body) if name == "load" else _in_own_units(named, units)
    return found


def _is_of_each(group: Group, parts: Sequence[str]) -> bool:
    """Whether a group has one entry for each joint, or foot, whose name comes first."""
    return len(group.names) == len(parts) and all(
        name.startswith(f"{part} ") for name, part in zip(group.names, parts, strict=True)
    )


def _in_own_units(group: Group, units: Units) -> Group:
    """Return a group whose metres are heights, and whose seconds are pendulum times."""
    sizes = {"m": units.length, "m/s": units.speed, "rad/s": units.rate}
    found = [_UNIT.search(name) for name in group.names]
    size = np.array([sizes[unit[1]] if unit else 1.0 for unit in found])
    names = tuple(
        f"{name[: unit.start()]}({_OWN[unit[1]]}{unit[2] or ''})" if unit else name
        for name, unit in zip(group.names, found, strict=True)
    )
    return group._replace(names=names, unit=size)


def _foot_loads(body: Body) -> Group:
    """Return the load on each foot: robots have more or fewer points on one."""
    robot, foot_of_point = body.robot, body.stance.geometry.foot_of_point
    of_foot = (foot_of_point[:, None] == np.arange(robot.num_feet)) / robot.weight
    return Group.of(
        "normal force on foot {} (share of the weight)",
        map(str, range(robot.num_feet)),
        100.0,
        lambda m: m.outcome.state.contact_force[:, :, 2] @ of_foot,
        FORCES,
    )
