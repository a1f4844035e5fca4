"""Height scan: the ground around a robot as it observes it."""

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.motions.gait.heading import axes_of_trunk, in_world
from fbid_gym.quantities import DynamicsTerms

SCAN = np.array([(x, y) for x in np.arange(-2, 5) * 0.5 for y in np.arange(-2, 3) * 0.4])
"""(35, 2) where the ground is seen: heights of the centre of mass ahead and to the left."""


@kernel
def scanned(offsets: np.ndarray, terms: DynamicsTerms) -> np.ndarray:
    """Return the places (N, S, 2) m around N robots where the ground is seen.

    The offsets (S, 2) are m from the base, ahead and to the left as it heads.
    """
    count = len(terms.base_position)
    found = np.empty((count, len(offsets), 2))
    for i in range(count):
        base, axes = terms.base_position[i], axes_of_trunk(terms.world_from_trunk[i])
        for k in range(len(offsets)):
            x, y = in_world(axes, offsets[k, 0], offsets[k, 1])
            found[i, k, 0], found[i, k, 1] = base[0] + x, base[1] + y
    return found


def in_place(
    points: np.ndarray, terms: DynamicsTerms, actual: DynamicsTerms
) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, F, 3) m about robots that believe to be elsewhere, where they are.

    Args:
        points: in the world as the robots believe it to be.
        terms: where they believe to be.
        actual: where they are.

    Returns:
        points: (N, F, 3) m, seen from the base's place and heading as before; z is left out.
        above: (N,) m by which the base believes to be higher than it is.
    """
    turn = _headings(actual) * _headings(terms).conj()
    away = points - terms.base_position[:, None]
    flat = (away[..., 0] + 1j * away[..., 1]) * turn[:, None]
    places = np.zeros(points.shape)
    places[..., 0] = actual.base_position[:, None, 0] + flat.real
    places[..., 1] = actual.base_position[:, None, 1] + flat.imag
    return places, terms.base_position[:, 2] - actual.base_position[:, 2]


def _headings(terms: DynamicsTerms) -> np.ndarray:
    """Headings as complex numbers (N,) of size 1."""
    ahead = terms.world_from_trunk[:, 0, 0] + 1j * terms.world_from_trunk[:, 1, 0]
    return ahead / (np.abs(ahead) + 1e-12)
