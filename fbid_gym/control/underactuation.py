"""In how many directions of the base the contacts cannot push."""

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.small_matrices import dot, factor, gram, solve_factored_columns

# Contacts whose shortest lever arm is below a thousandth of the longest count as a line or a point.
_RTOL = 1e-6


def underactuation(jacobian: np.ndarray) -> np.ndarray:
    """Six less the rank of the base columns of J: (N,), whole numbers; six if not finite.

    Args:
        jacobian: (N, k, nv) of the contacts.
    """
    missing = np.empty(len(jacobian))
    _count(jacobian, missing)
    return missing


@kernel
def _count(jacobian: np.ndarray, missing: np.ndarray) -> None:
    count, rows, _ = jacobian.shape
    base, push = np.empty((6, rows)), np.empty((6, 6))
    lower, inverse = np.empty((6, 6)), np.empty((6, 6))
    for i in range(count):
        for row in range(6):
            for k in range(rows):
                base[row, k] = jacobian[i, k, row]
        gram(base, base, 0.0, push)
        size, inverse_size = 0.0, 0.0
        for row in range(6):
            for column in range(6):
                push[row, column] = push[max(row, column), min(row, column)]
                lower[row, column] = push[row, column]
                inverse[row, column] = 1.0 if row == column else 0.0
        factor(lower)
        solve_factored_columns(lower, inverse)
        for row in range(6):
            size += dot(push[row], push[row])
            inverse_size += dot(inverse[row], inverse[row])
        # |A| |A^-1| bounds the condition number: most are certified so to be regular.
        missing[i] = 0.0
        if size * inverse_size < _RTOL**-2:
            continue
        missing[i] = 6.0
        if np.isfinite(push).all():
            values = np.linalg.eigvalsh(push)
            missing[i] -= (values > _RTOL * values[5]).sum()
