"""Solve the constraint that contacts stay where they are."""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.small_matrices import (
    add_transposed_times,
    dot,
    factor_damped,
    gram,
    solve_factored,
    times,
)

# Legs without a joint that turns their sole that way hold each other in it: what such a constraint
# asks of the joints is hundreds of times the motion, and comes from rounding and from real contacts
# being soft. So directions whose squared gain is less than this share of what joints move fade out.
# Both are taken in the metric A, so that nothing depends on its size. They do depend on how much
# the base counts in it: a heavy one hardly gives way, and directions that it alone serves fade out
# sooner.
_FAINT = 5e-6


class Held(NamedTuple):
    """Factors of the constraint that contacts stay; buffers of one robot."""

    weighted: np.ndarray  # (k, nv): J A^-1
    factor: np.ndarray  # (k, k), lower half: factors of J A^-1 J^T, as far as contacts can be held
    force: np.ndarray  # (k,)


@compiled
def hold(jacobian: np.ndarray, mobility: np.ndarray, held: Held) -> None:
    """Fill `held` for a Jacobian (k, nv) and the diagonal of A^-1, (nv,).

    Repeated rows and rows of zeros are fine.
    """
    weighted, lower = held.weighted, held.factor
    for k in range(len(jacobian)):
        for j in range(jacobian.shape[1]):
            weighted[k, j] = jacobian[k, j] * mobility[j]
    gram(weighted, jacobian, 0.0, lower)
    total = 0.0
    for i in range(len(jacobian)):
        total += dot(weighted[i, 6:], jacobian[i, 6:])
    for i in range(len(jacobian)):
        # A row of zeros holds nothing, whatever its force.
        if lower[i, i] == 0.0:
            lower[i, i] = total if total > 0.0 else 1.0
    factor_damped(lower, _FAINT * total)


@compiled
def make_consistent(
    held: Held, jacobian: np.ndarray, jacobian_bias: np.ndarray, acceleration: np.ndarray
) -> None:
    """Change an acceleration (nv,) as little as the contacts demand, [M10] eq. (4)."""
    times(jacobian, acceleration, held.force)
    for k in range(len(held.force)):
        held.force[k] = -(held.force[k] + jacobian_bias[k])
    solve_factored(held.factor, held.force)
    add_transposed_times(held.weighted, held.force, acceleration)
