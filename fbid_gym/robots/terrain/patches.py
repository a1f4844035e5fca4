"""Kinds of ground to walk on: what one square patch of each looks like, in units of the robot.

A patch is level in its middle, where robots start, and comes down to the plane at its edge, so that
patches of any kind and difficulty lie side by side. Its difficulty, from 0 to 1, scales heights,
angles and the width of gaps; 0 is level.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fbid_gym.robots.terrain.obstacles import random_planks

EDGE = 14.0  # length of a patch's edge
CLEARING = 1.5  # radius of the level place in its middle
# The robot's unit of length is the height of its centre of mass; of heights, what its feet clear.
_RIM = 0.8  # width of the level strip along the edge
_TOP = 2.0  # half the edge of the level top of a hill
_STEEPEST = np.tan(np.radians(25.0))
_BUMP, _BUMP_SPACING = 0.35, 0.6
_STEP, _TREAD = 0.45, 1.0
_PLANK, _PER_AREA, _LENGTH = 0.4, 0.16, (2.0, 6.0)  # height, number per area, length
_DEPTH, _GAP, _ISLAND = 1.0, 0.7, 2.0
_FIRST_GAP = CLEARING + 0.5
_VERGE, _RAMP = 0.2, 2.0  # level strip along the edge, and way up from it, where there are gaps


class Places(NamedTuple):
    """The nodes of a patch, (R, R) each, from its middle, in heights of the centre of mass."""

    x: np.ndarray  # ahead
    y: np.ndarray  # to the left
    reach: float  # height that this robot's feet clear with ease, in the same unit

    @property
    def ring(self) -> np.ndarray:
        """Distance from the middle: the larger of |x| and |y|."""
        return np.maximum(abs(self.x), abs(self.y))


def _slopes(places: Places, difficulty: float, rng: np.random.Generator) -> np.ndarray:
    """A hill with four even sides."""
    run = 0.5 * EDGE - _RIM - np.maximum(places.ring, _TOP)
    return places.reach * _STEEPEST * difficulty * np.maximum(run, 0.0)


def _roughness(places: Places, difficulty: float, rng: np.random.Generator) -> np.ndarray:
    """Random heights, evenly joined."""
    count = int(np.ceil(EDGE / _BUMP_SPACING)) + 2
    bumps = rng.uniform(0.0, 1.0, (count, count))
    u, v = (np.clip((w + 0.5 * EDGE) / _BUMP_SPACING, 0.0, count - 1.001) for w in places[:2])
    column, row = u.astype(int), v.astype(int)
    s, t = u - column, v - row
    near = (1.0 - s) * bumps[row, column] + s * bumps[row, column + 1]
    far = (1.0 - s) * bumps[row + 1, column] + s * bumps[row + 1, column + 1]
    even = np.clip(0.5 * EDGE - places.ring, 0.0, 1.0) * _beyond_clearing(places)
    return places.reach * _BUMP * difficulty * ((1.0 - t) * near + t * far) * even


def _stairs(places: Places, difficulty: float, rng: np.random.Generator) -> np.ndarray:
    """Steps up to a level top from all four sides."""
    run = np.maximum(0.5 * EDGE - _RIM - np.maximum(places.ring, _TOP), 0.0)
    return places.reach * _STEP * difficulty * np.ceil(run / _TREAD - 1e-9)


def _planks(places: Places, difficulty: float, rng: np.random.Generator) -> np.ndarray:
    """Low obstacles lying about."""
    planks = random_planks(_PER_AREA, _LENGTH, (0.5, 1.0), EDGE, 1.0, rng)
    free = (0.5 * EDGE - places.ring > 0.2) & (_beyond_clearing(places) > 0.0)
    return places.reach * _PLANK * difficulty * planks.height(places.x, places.y) * free


def _gaps(places: Places, difficulty: float, rng: np.random.Generator) -> np.ndarray:
    """Square rings of raised ground with gaps between them, reached by a ramp from the edge.

    There are as many at all difficulties: those that leave level ground on both sides when widest.
    """
    end = 0.5 * EDGE - _VERGE
    ramp = np.clip((end - places.ring) / _RAMP, 0.0, 1.0)
    cell = float(places.x[0, 1] - places.x[0, 0])
    # As many nodes lie low in each, however the grid falls upon it; one where it is narrower.
    nodes = max(np.ceil(_GAP * difficulty / cell - 0.5 - 1e-9), 1.0)
    gap = np.zeros(places.x.shape, bool)
    for first in np.arange(_FIRST_GAP, end - _RAMP - _GAP, _ISLAND):
        node = np.floor((places.ring - first) / cell)
        gap |= (node >= 0.0) & (node < nodes)
    return places.reach * _DEPTH * difficulty * np.where(gap, 0.0, ramp)


def _beyond_clearing(places: Places) -> np.ndarray:
    """0 in the middle, 1 half a unit beyond the clearing."""
    return np.clip(2.0 * (np.hypot(places.x, places.y) - CLEARING - 0.2), 0.0, 1.0)


class Patch(NamedTuple):
    """A kind of patch."""

    # (places, difficulty, generator) -> elevation (R, R) in heights of the centre of mass
    make: Callable[[Places, float, np.random.Generator], np.ndarray]
    # Tangent of its slopes, or height of its highest step, in heights of the centre of mass, at
    # difficulty 1 and for feet that clear one with ease.
    hardest: float


PATCHES = {
    "slopes": Patch(_slopes, float(_STEEPEST)),
    "roughness": Patch(_roughness, _BUMP),
    "stairs": Patch(_stairs, _STEP),
    "planks": Patch(_planks, _PLANK),
    "gaps": Patch(_gaps, _DEPTH),
}
"""Kinds of patches by name."""
