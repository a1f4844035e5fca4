"""The robots that come with the library: file, feet and home pose of each."""

import functools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from fbid_gym.checks import check_choices
from fbid_gym.errors import RobotError
from fbid_gym.own_files import asset_places
from fbid_gym.robots import zoo
from fbid_gym.robots.robot import Robot
from fbid_gym.robots.source import MENAGERIE


class BuiltIn(NamedTuple):
    """One of them; every mass, length and limit has its source in the file."""

    asset: str  # name of the file in `assets/`
    feet: Mapping[str, tuple[str, ...]]
    home: dict[str, float]  # rad; joints not named are 0


_SOLES = {
    side: tuple(f"{side}_{corner}" for corner in ("toe_out", "toe_in", "heel_out", "heel_in"))
    for side in ("left", "right")
}
"""The corners of each sole; four points on a foot, [M10] IV.A."""

_POINTS = {
    leg: (f"{leg}_foot",) for leg in ("front_left", "front_right", "hind_left", "hind_right")
}


def _on_soles(
    hip: float, knee: float, arms: Mapping[str, float] = {}, outwards: Mapping[str, float] = {}
) -> dict[str, float]:
    """Name the angles of both sides; those `outwards` change their sign from left to right.

    The knees are bent enough to lift a foot or take a push. The ankle keeps the sole flat under an
    upright trunk, and the hip angle is the one that puts the centre of mass over the centre of the
    soles (solved for; the tests hold it to 1 mm).
    """
    pitch = {"hip_pitch": hip, "knee": knee, "ankle_pitch": -hip - knee, **arms}
    return {
        f"{side}_{joint}": sign * angle
        for side, mirror in (("left", 1.0), ("right", -1.0))
        for angles, sign in ((pitch, 1.0), (outwards, mirror))
        for joint, angle in angles.items()
    }


def _on_points(hip: float, knee: float, hind: float) -> dict[str, float]:
    """Name the angles of four legs; `hind` is the sign of those of the hind legs."""
    return {
        f"{end}_{side}_{joint}": sign * angle
        for end, sign in (("front", 1.0), ("hind", hind))
        for side in ("left", "right")
        for joint, angle in (("hip_pitch", hip), ("knee", knee))
    }


BIPED = BuiltIn("biped.xml", _SOLES, _on_soles(-0.2105, 0.45))
"""The biped of [M10] IV.A: lower half of a Sarcos-class humanoid, 16 joints, two flat feet."""

# The knee angle puts each foot straight below its hip, with upper and lower links of 0.0751 m and
# 0.102 m, so the centre of mass is over the centre of the feet; the hip angle makes it 0.20 m tall.
_HIP = 0.6
_KNEE = -_HIP - math.asin(0.0751 * math.sin(_HIP) / 0.102)

QUADRUPED = BuiltIn("quadruped.xml", _POINTS, _on_points(_HIP, _KNEE, hind=-1.0))
"""A LittleDog-like quadruped: 12 joints, four point feet."""

HUMANOID = BuiltIn(
    "humanoid.xml",
    _SOLES,
    _on_soles(
        *(-0.26, 0.6, {"shoulder_pitch": 0.25, "elbow": -0.9}),
        {"shoulder_roll": 0.1, "shoulder_yaw": -0.2},
    ),
)
"""A humanoid of TORO's kind, the robot of [G15] section V: 27 joints, two flat feet.

The knees are bent as far as brings the robot from 1.74 m to the 1.7 m of [G15].
"""

# The hips are 0.29 m above the floor. The feet are not quite below them: the trunk's centre of mass
# lies ahead of its middle, and these angles put the feet's centre below the robot's (solved for;
# the tests hold it to 1 mm).
GO1 = BuiltIn("go1.xml", _POINTS, _on_points(0.8922, -1.7686, hind=1.0))
"""A quadruped of the Unitree Go1's class: 12 joints, 12.7 kg, four point feet."""

G1 = BuiltIn(
    "g1.xml",
    _SOLES,
    _on_soles(-0.2638, 0.6, {"shoulder_pitch": 0.2, "elbow": 0.9}, {"shoulder_roll": 0.2}),
)
"""A humanoid of the Unitree G1's class: 29 joints, 33.3 kg, two flat feet."""

BUILT_IN = {"biped": BIPED, "quadruped": QUADRUPED, "humanoid": HUMANOID, "go1": GO1, "g1": G1}

ROBOTS = tuple(BUILT_IN)
"""Names of the built-in robots."""


@functools.lru_cache(256)
def load(name: str) -> Robot:
    """Load a built-in robot, "menagerie:NAME" or "zoo:SEED"; the same object every time.

    Raises:
        UnknownOptionError: no robot of this name.
        FbidError: as `Robot.load`.
    """
    if name.startswith(MENAGERIE):
        return Robot.load(name)
    if name.startswith(zoo.ZOO):
        return zoo.named(name)
    check_choices("robot", [name], ROBOTS)
    asset, feet, home = BUILT_IN[name]
    return Robot.from_mjcf(asset_path(asset), feet, name=name, home=home)


def asset_path(name: str) -> Path:
    """Path of a file in `assets/`; raises RobotError where there is none."""
    places = asset_places(name)
    for path in places:
        if path.is_file():
            return path
    raise RobotError(f"Asset {name!r} not found. Looked at: {', '.join(map(str, places))}.")
