"""Slope of the ground, felt by the feet: the plane through the places where they last stood.

Its slope is a least squares fit to these places, averaged over a while and drawn towards level. The
average is taken of the moments, not of the slope: so two feet tell of both directions, once they
have stood in several places, and feet that stand in a line leave the slope across it level.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled


class Sense(NamedTuple):
    """Constants of a gait's sense of the ground."""

    time: float  # s over which the places of the feet are averaged
    # m^2, mean square distance of the feet from their middle, along one axis, below which the
    # ground along that axis is rather taken to be level.
    level: float


class Plane(NamedTuple):
    """Ground through a point (m, world), with the tangents of its slope along the world's axes."""

    x: float
    y: float
    z: float
    slope_x: float
    slope_y: float


def level_moments(touched: np.ndarray) -> np.ndarray:
    """Return the moments (N, 5) of level ground below feet at (N, F, 3) m, see `feel_ground`."""
    away = (touched - touched.mean(axis=1, keepdims=True))[:, :, :2]
    square = (away.mT @ away) / touched.shape[1]
    nothing = np.zeros(len(touched))
    return np.stack([square[:, 0, 0], square[:, 0, 1], square[:, 1, 1], nothing, nothing], axis=1)


@compiled
def feel_ground(sense: Sense, tick: float, touched: np.ndarray, moments: np.ndarray) -> Plane:
    """Return the plane of the ground below one robot.

    Args:
        sense: of the gait.
        tick: s since the last call.
        touched: (F, 3) m, world, where each foot stands or last stood.
        moments: (5,) m^2, means of the products xx, xy, yy, xz and yz of the feet's distances from
            their middle; updated.
    """
    feet = len(touched)
    x, y, z = 0.0, 0.0, 0.0
    for foot in range(feet):
        x += touched[foot, 0] / feet
        y += touched[foot, 1] / feet
        z += touched[foot, 2] / feet
    keep = max(1.0 - tick / sense.time, 0.0)
    share = (1.0 - keep) / feet
    for k in range(5):
        moments[k] *= keep
    for foot in range(feet):
        ahead, left, up = touched[foot, 0] - x, touched[foot, 1] - y, touched[foot, 2] - z
        moments[0] += share * ahead * ahead
        moments[1] += share * ahead * left
        moments[2] += share * left * left
        moments[3] += share * ahead * up
        moments[4] += share * left * up
    a, b, c = moments[0] + sense.level, moments[1], moments[2] + sense.level
    size = a * c - b * b
    slope_x = (c * moments[3] - b * moments[4]) / size
    slope_y = (a * moments[4] - b * moments[3]) / size
    return Plane(x, y, z, slope_x, slope_y)


@compiled
def height_on(plane: Plane, x: float, y: float) -> float:
    """Return the height of the ground at a place, m."""
    return plane.z + plane.slope_x * (x - plane.x) + plane.slope_y * (y - plane.y)
