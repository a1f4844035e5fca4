"""Heading of a walking robot, seen from above, and vectors along it."""

import math

import numpy as np

from fbid_gym.compiled import compiled

Pair = tuple[float, float]

_LOST = 0.3  # rad that the robot may be turned from its heading before that follows


@compiled
def wrapped(angle: float) -> float:
    """Return the same angle (rad) in -pi … pi."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@compiled
def turned_on(heading: float, turn: float, world_from_trunk: np.ndarray) -> float:
    """Return a heading (rad), turned on, and kept near that of a trunk with a rotation (3, 3)."""
    body = math.atan2(world_from_trunk[1, 0], world_from_trunk[0, 0])
    ahead = wrapped(heading + turn - body)
    return body + min(max(ahead, -_LOST), _LOST)


@compiled
def axes_of(heading: float) -> Pair:
    """Return the cosine and sine of a heading (rad)."""
    return math.cos(heading), math.sin(heading)


@compiled
def axes_of_trunk(world_from_trunk: np.ndarray) -> Pair:
    """Return the cosine and sine of the heading of a trunk with a rotation (3, 3)."""
    size = np.hypot(world_from_trunk[0, 0], world_from_trunk[1, 0]) + 1e-12
    return world_from_trunk[0, 0] / size, world_from_trunk[1, 0] / size


@compiled
def in_world(axes: Pair, ahead: float, left: float) -> Pair:
    """Return in the world a vector that is given along the axes of a heading."""
    return axes[0] * ahead - axes[1] * left, axes[1] * ahead + axes[0] * left


@compiled
def along(axes: Pair, x: float, y: float) -> Pair:
    """Return a vector of the world along the axes of a heading: ahead and to the left."""
    return axes[0] * x + axes[1] * y, -axes[1] * x + axes[0] * y


@compiled
def turned(angle: float, x: float, y: float) -> Pair:
    """Return a horizontal vector, turned to the left by an angle (rad)."""
    return in_world(axes_of(angle), x, y)


@compiled
def share_within(most: float, x: float, y: float) -> float:
    """Return the greatest share, up to 1, of a horizontal vector that is no longer than `most`."""
    return min(1.0, most / (math.hypot(x, y) + 1e-12))
