"""Height scan: the ground around a robot as it observes it."""

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.motions.gait.heading import axes_of_trunk, in_world
from fbid_gym.quantities import DynamicsTerms
from fbid_gym.robots.terrain.grid import HeightGrid, height_at

SCAN = np.array([(x, y) for x in np.arange(-2, 5) * 0.5 for y in np.arange(-2, 3) * 0.4])
"""(35, 2) where the ground is seen: heights of the centre of mass ahead and to the left."""


@kernel
def scan_heights(
    ground: HeightGrid, offsets: np.ndarray, terms: DynamicsTerms, below: np.ndarray
) -> np.ndarray:
    """Return how high the ground is around N robots, (N, S) m, above `below` (N,) m.

    Args:
        ground: its heights.
        offsets: (S, 2) m from the base, ahead and to the left as it heads.
        terms: where the robots are.
        below: m, height of the ground below the feet.
    """
    count = len(below)
    found = np.empty((count, len(offsets)))
    for i in range(count):
        base, axes = terms.base_position[i], axes_of_trunk(terms.world_from_trunk[i])
        for k in range(len(offsets)):
            x, y = in_world(axes, offsets[k, 0], offsets[k, 1])
            found[i, k] = height_at(ground, base[0] + x, base[1] + y) - below[i]
    return found
