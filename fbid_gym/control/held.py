"""What it takes to keep contacts where they are."""

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.small_matrices import dot, gram, invert_damped

# Legs without a joint that turns their sole that way hold each other in it: what such a constraint
# asks of the joints is a thousand times the motion, and comes from rounding and from real contacts
# being soft. So directions whose squared gain is less than this share of all fade out, whatever the
# metric A.
_FAINT = 1e-6


@compiled
def invert_contacts(weighted: np.ndarray, jacobian: np.ndarray, inverse: np.ndarray) -> None:
    """Write the inverse (k, k) of J A^-1 J^T, of what the contacts can be held by.

    Args:
        weighted: (k, nv) J A^-1.
        jacobian: (k, nv) J; repeated and zero rows are fine.
        inverse: to write to.
    """
    rows = len(jacobian)
    gains = np.empty((rows, rows))
    gram(weighted, jacobian, 0.0, gains)
    total = 0.0
    for i in range(rows):
        total += dot(jacobian[i], jacobian[i])
    if total == 0.0:
        total = 1.0
    for i in range(rows):
        # A row of zeros holds nothing, whatever its force.
        if gains[i, i] == 0.0:
            gains[i, i] = total
        for j in range(i):
            gains[j, i] = gains[i, j]
    invert_damped(gains, _FAINT * total, inverse)
