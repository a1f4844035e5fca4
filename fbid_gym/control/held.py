"""What it takes to keep contacts where they are."""

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.small_matrices import dot, factor_damped, gram

# Legs without a joint that turns their sole that way hold each other in it: what such a constraint
# asks of the joints is hundreds of times the motion, and comes from rounding and from real contacts
# being soft. So directions whose squared gain is less than this share of what joints move fade out.
# Both are taken in the metric A, so that nothing depends on its size. They do depend on how much
# the base counts in it: a heavy one hardly gives way, and directions that it alone serves fade out
# sooner.
_FAINT = 5e-6


@compiled
def factor_contacts(weighted: np.ndarray, jacobian: np.ndarray, lower: np.ndarray) -> None:
    """Write the factors of J A^-1 J^T, as far as contacts can be held.

    Args:
        weighted: (k, nv) J A^-1.
        jacobian: (k, nv) J; repeated and zero rows are fine.
        lower: (k, k), whose lower half is written to.
    """
    gram(weighted, jacobian, 0.0, lower)
    total = 0.0
    for i in range(len(jacobian)):
        total += dot(weighted[i, 6:], jacobian[i, 6:])
    for i in range(len(jacobian)):
        # A row of zeros holds nothing, whatever its force.
        if lower[i, i] == 0.0:
            lower[i, i] = total if total > 0.0 else 1.0
    factor_damped(lower, _FAINT * total)
