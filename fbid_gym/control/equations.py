"""What the laws of [M10] start from, checked."""

from typing import Any

import numpy as np

from fbid_gym.checks import check_shape, contiguous, positive_numbers
from fbid_gym.errors import ShapeError
from fbid_gym.quantities import Constraint, EquationOfMotion


def checked_equations(
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    jacobian: np.ndarray,
    acceleration: np.ndarray,
    jacobian_bias: np.ndarray,
) -> tuple[EquationOfMotion, Constraint, np.ndarray]:
    """Return the equation of motion, the contacts' constraint, and the desired acceleration.

    Args:
        mass_matrix: (N, nv, nv) M.
        bias: (N, nv) h.
        jacobian: (N, k, nv) J.
        acceleration: (N, nv) desired.
        jacobian_bias: (N, k) Jdot v.

    Raises:
        ShapeError: an array does not fit.
    """
    shape = tuple(jacobian.shape)
    if len(shape) != 3 or shape[2] < 6:
        raise ShapeError("jacobian", shape, "(N, k, nv) with nv of at least 6")
    count, rows, velocities = shape
    check_shape("mass_matrix", mass_matrix, (count, velocities, velocities), "(N, nv, nv)")
    check_shape("bias", bias, (count, velocities), "(N, nv)")
    check_shape("acceleration", acceleration, (count, velocities), "(N, nv)")
    check_shape("jacobian_bias", jacobian_bias, (count, rows), "(N, k)")
    return (
        EquationOfMotion(contiguous(mass_matrix), contiguous(bias)),
        Constraint(contiguous(jacobian), contiguous(jacobian_bias)),
        contiguous(acceleration),
    )


def mobility_of(velocities: int, base_priority: Any) -> np.ndarray:
    """How readily coordinates depart from their desired acceleration: (nv,), one for joints.

    Args:
        velocities: nv.
        base_priority: weight of squared base accelerations, one or six of them.

    Raises:
        InvalidValueError: `base_priority` is not positive and finite.
    """
    mobility = np.ones(velocities)
    mobility[:6] /= positive_numbers("base_priority", base_priority, 1, 6)
    return mobility
