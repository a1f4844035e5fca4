"""In how many directions of the base the contacts cannot push."""

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.small_matrices import gram, rank_of

# Contacts whose shortest lever arm is below a thousandth of the longest count as a line or a point.
_RTOL = 1e-6


@kernel
def underactuation(jacobian: np.ndarray) -> np.ndarray:
    """Six less the rank of the base columns of J: (N,) float; six if not finite.

    Args:
        jacobian: (N, k, nv) of the contacts.
    """
    count, rows, _ = jacobian.shape
    missing = np.empty(count)
    base, push = np.empty((6, rows)), np.empty((6, 6))
    for i in range(count):
        for row in range(6):
            for k in range(rows):
                base[row, k] = jacobian[i, k, row]
        gram(base, base, 0.0, push)
        missing[i] = 6.0 - rank_of(push, _RTOL)
    return missing
