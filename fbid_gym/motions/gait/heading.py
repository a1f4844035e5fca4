"""Which way a walking robot faces, seen from above: its heading, and vectors along it."""

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
def turned_on(heading: float, turn: float, world_from_base: np.ndarray) -> float:
    """Return a heading (rad), turned on, and kept near that of a body with a rotation (3, 3)."""
    body = math.atan2(world_from_base[1, 0], world_from_base[0, 0])
    ahead = wrapped(heading + turn - body)
    return body + min(max(ahead, -_LOST), _LOST)


@compiled
def axes_of(heading: float) -> Pair:
    """Return the cosine and sine of a heading (rad)."""
    return math.cos(heading), math.sin(heading)


@compiled
def axes_of_base(world_from_base: np.ndarray) -> Pair:
    """Return the cosine and sine of the heading of a base with a rotation (3, 3)."""
    size = np.hypot(world_from_base[0, 0], world_from_base[1, 0]) + 1e-12
    return world_from_base[0, 0] / size, world_from_base[1, 0] / size


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
def lean(heading: float, world_from_base: np.ndarray) -> tuple[float, float, float]:
    """Return axis times sine of the rotation from a base, (3, 3), to upright in a heading (rad).

    In the base's axes.
    """
    base, (cosine, sine) = world_from_base, axes_of(heading)
    # E = R^T D, D the turn about the vertical; its axial vector.
    e10 = base[0, 1] * cosine + base[1, 1] * sine
    e20 = base[0, 2] * cosine + base[1, 2] * sine
    e01 = base[1, 0] * cosine - base[0, 0] * sine
    e21 = base[1, 2] * cosine - base[0, 2] * sine
    return 0.5 * (e21 - base[2, 1]), 0.5 * (base[2, 0] - e20), 0.5 * (e10 - e01)
