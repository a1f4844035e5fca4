"""Ground that is not level, laid around a robot's world.

One model serves all robots of a batch: the ground is large and random, so a robot that starts at a
random place with a random heading meets a terrain of its own. Places to start from are level. All
lengths follow the robot's size, but for the height of obstacles and rocks.

## Description
The ground is a square of five by five patches, each 14 h long, level in the middle and along the
edge. At difficulty d, with c = 1 for robots on point feet and c = 0.2 for those on soles:

| Terrain     | What it is                         | Size                          |
| ----------- | ---------------------------------- | ----------------------------- |
| `slopes`    | hills with four even sides         | tangent 0.47 c d (25 degrees) |
| `roughness` | random heights 0.6 h apart, joined | up to 0.35 c d h              |
| `stairs`    | steps of 1 h up to a level top     | 0.45 c d h each               |
| `planks`    | low obstacles lying about          | 0.2 c d h to 0.4 c d h high   |
| `gaps`      | raised ground, two gaps 2 h apart  | 0.7 d h wide, c d h deep      |
| `mixed`     | patches of all of these            |                               |

Difficulty 0 is level. The sides of stairs, planks and gaps are 0.14 h wide, a cell of the height
field. Gaps go around the middle of a patch, 2 h and 4 h away; from middle to middle of their sides
they are whole cells wide, at least one.

## Starting State
On one of the nine inner patches, in its level middle.

## Episode End
The end of the ground truncates, too: at top speed a robot gets there before 20 s have passed, from
an outer start after 21 h.
"""

import mujoco
import numpy as np

from fbid_gym.checks import check_choices
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Number
from fbid_gym.robots.robot import Robot
from fbid_gym.robots.terrain.field import Field, Tiles
from fbid_gym.robots.terrain.grid import HeightGrid, plane
from fbid_gym.robots.terrain.levels import NUM_LEVELS, make_levels
from fbid_gym.robots.terrain.obstacles import Obstacles, random_obstacles
from fbid_gym.robots.terrain.patches import PATCHES
from fbid_gym.robots.terrain.rocks import random_rocks

__all__ = [
    "LEVELLED",
    "NUM_LEVELS",
    "TERRAINS",
    "HeightGrid",
    "Terrain",
    "Tiles",
    "check_height",
    "hardest",
    "make_terrain",
    "plane",
    "world_of",
]

LEVELLED = (*PATCHES, "mixed")  # names of the terrains that have a difficulty
TERRAINS = ("flat", "obstacles", "rocks", *LEVELLED)
Terrain = Field | Obstacles  # ground on top of the plane z = 0

_LEAST_REACH = 0.1
_SPACING = 10.0  # of the places to start from, in reaches of the robot: 0.12 m for `quadruped`
_HEIGHT = 0.04  # m
# Share of the height of the centre of mass that feet clear with ease: on points, and on soles.
_REACH = {False: 1.0, True: 0.2}


def make_terrain(
    name: str,
    robot: Robot,
    *,
    height: float | None = None,
    difficulty: float | None = 0.5,
    seed: int = 0,
) -> Terrain:
    """Make a terrain for a robot.

    Args:
        name: "flat"; "obstacles", planks lying about, from half of `height` to `height` tall;
            "rocks", a board of rounded stones of up to `height`; or one of `LEVELLED`: "slopes",
            "roughness", "stairs", "planks", "gaps", and "mixed", patches of all of these.
        robot: for whose size.
        height: m, of the highest point of obstacles or rocks. 0 is flat. Default: 4 cm.
        difficulty: of a levelled terrain, from 0, which is flat, to 1. None: `NUM_LEVELS` levels
            from 0 to 1, side by side.
        seed: decides where everything lies.

    Raises:
        UnknownOptionError: no terrain of this name.
        InvalidValueError: `height` of obstacles or rocks is negative or more than that of the
            robot, or of a levelled terrain is given; `difficulty` is not within 0 and 1.
    """
    check_choices("terrain", [name], TERRAINS)
    check_height(name, height)
    if difficulty is not None:
        Number(0.0, 1.0).check("difficulty", difficulty)
    if name in LEVELLED:
        levels = np.linspace(0.0, 1.0, NUM_LEVELS) if difficulty is None else np.array([difficulty])
        return make_levels(name, float(robot.at_home.com[2]), _REACH[robot.has_soles], levels, seed)
    height = _HEIGHT if height is None else height
    if name == "flat" or height == 0.0:
        return Field(np.zeros((1, 2)), np.inf)
    # A base's frame may lie anywhere in it, near the soles as well.
    tallest = float(max(robot.home_qpos[2], robot.at_home.com[2]))
    if not 0.0 <= height <= tallest:
        raise InvalidValueError(
            "terrain height",
            height,
            f"metres from 0 to {tallest:.3g}, where {robot.name!r} has its base or centre of mass",
        )
    reach, rng = _reach(robot), np.random.default_rng(seed)
    line = _SPACING * reach * np.array([-1.0, 0.0, 1.0])
    starts = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    if name == "obstacles":
        return random_obstacles(reach, height, starts, rng)
    return random_rocks(reach, height, starts, rng)


def check_height(name: str, height: float | None) -> None:
    """Raise InvalidValueError where a height is given for a terrain whose difficulty decides."""
    if name in LEVELLED and height is not None:
        expected = f"none on terrain {name!r}, whose size follows difficulty and the robot's size"
        raise InvalidValueError("terrain_height", height, expected)


def hardest(kind: str, robot: Robot) -> float:
    """Return what difficulty 1 of a kind of patch means for a robot's feet; lower ones, less of it.

    That is the tangent of slopes; otherwise the height of the highest step, in heights of the
    centre of mass at home. Kinds are those of `LEVELLED` but "mixed".
    """
    check_choices("kind of patch", [kind], PATCHES)
    return _REACH[robot.has_soles] * PATCHES[kind].hardest


def world_of(robot: Robot, terrain: Terrain) -> mujoco.MjSpec:
    """Return the robot's world with a terrain in it; the robot keeps its coordinates."""
    spec = robot.spec.copy()
    terrain.add_to(spec)
    return spec


def _reach(robot: Robot) -> float:
    """Largest horizontal distance of a contact point from the base at home, m.

    At least a share of the robot's height: it may stand on a point below its base.
    """
    offset = (robot.points_at_home - robot.at_home.data.xpos[robot.base_body])[:, :2]
    farthest = np.linalg.norm(offset, axis=1).max()
    return float(max(farthest, _LEAST_REACH * robot.at_home.com[2]))
