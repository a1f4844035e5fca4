"""Least torque where slides and hinges mix: eq. (15) in a metric that makes units homogeneous.

A sum of squares of N and N·m is a sum of nothing: a robot described in millimetres would get other
torques from [M10] eq. (15) than the same robot in metres. [M10] III-B.3 first projects the dynamics
into a space of homogeneous units, by a symmetric positive definite matrix B that measures
velocities, |v|^2 = v^T B v. With B = L L^T (Cholesky) and v' = L^T v the dynamics are

    M' = L^-1 M L^-T,   h' = L^-1 h,   J' = J L^-T,   a' = L^T a,   S^T tau' = L^-1 S^T tau,

of the same form as before, because L^T is upper triangular and the base comes first: v'_q depends
on joint velocities only. Eq. (15) there gives the torque that minimises, of all with the same
motion, |tau'|^2 = tau^T (S B^-1 S^T) tau, and takes "the nearest acceleration" in the metric B.

Two metrics whose results do not depend on units: `length_metric`, in which a radian counts as a
characteristic length, and M itself, the kinetic energy, which needs no such choice but brings the
inertia, and its errors, back into the choice among torques ([M10], footnote 1).
"""

from collections.abc import Sequence

import numpy as np

from fbid_gym.checks import check_positive, check_shape
from fbid_gym.control.equations import checked_equations
from fbid_gym.control.inverse_dynamics import InverseDynamics, orthogonal_inverse_dynamics
from fbid_gym.errors import InvalidValueError


def length_metric(rotary: Sequence[bool] | np.ndarray, length: float) -> np.ndarray:
    """Metric in which a radian counts as `length` metres.

    Args:
        rotary: (n,) which joints turn; the others slide.
        length: m, characteristic, such as that of a leg.

    Returns:
        (nv,) diagonal of B: 1 for the base's position and slides, length^2 (m^2/rad^2) for the
        base's rotation and hinges.

    Raises:
        InvalidValueError: `length` is not positive and finite.
    """
    check_positive(length=length)
    turns = np.concatenate([[False] * 3, [True] * 3, np.asarray(rotary, dtype=bool)])
    return np.where(turns, length * length, 1.0)


def metric_inverse_dynamics(
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    jacobian: np.ndarray,
    acceleration: np.ndarray,
    jacobian_bias: np.ndarray,
    metric: np.ndarray,
) -> InverseDynamics:
    """Torques of [M10] eq. (15), the orthogonal decomposition taken in a homogeneous metric.

    Args:
        mass_matrix: (N, nv, nv) M, symmetric positive definite.
        bias: (N, nv) h.
        jacobian: (N, k, nv) J of the contact constraints.
        acceleration: (N, nv) desired.
        jacobian_bias: (N, k) Jdot v.
        metric: B on velocities: (nv,) positive diagonal, or (N, nv, nv) symmetric positive
            definite, such as the mass matrix.

    Returns:
        InverseDynamics in the units of the arguments.

    Raises:
        ShapeError: an array does not fit.
        InvalidValueError: the metric is not positive definite.
    """
    checked_equations(mass_matrix, bias, jacobian, acceleration, jacobian_bias)
    count, _, velocities = jacobian.shape
    if metric.ndim == 1:
        check_shape("metric", metric, (velocities,), "(nv,)")
        _check_diagonal(metric)
        scale = np.sqrt(metric)
        solution = orthogonal_inverse_dynamics(
            mass_matrix / (scale[:, None] * scale),
            bias / scale,
            jacobian / scale,
            acceleration * scale,
            jacobian_bias,
        )
        return solution._replace(
            torque=solution.torque * scale[6:], acceleration=solution.acceleration / scale
        )

    check_shape("metric", metric, (count, velocities, velocities), "(nv,) or (N, nv, nv)")
    factor = _cholesky(metric)
    inverse = np.linalg.inv(factor)
    solution = orthogonal_inverse_dynamics(
        inverse @ mass_matrix @ inverse.mT,
        np.matvec(inverse, bias),
        jacobian @ inverse.mT,
        np.matvec(factor.mT, acceleration),
        jacobian_bias,
    )
    return solution._replace(
        torque=np.matvec(factor[:, 6:, 6:], solution.torque),
        acceleration=np.matvec(inverse.mT, solution.acceleration),
    )


def _check_diagonal(metric: np.ndarray) -> None:
    """Raise unless the metric is a diagonal of positive, finite numbers."""
    valid = (metric > 0.0) & np.isfinite(metric)
    if not np.all(valid):
        entry = int(np.flatnonzero(~valid)[0])
        raise InvalidValueError(
            f"metric[{entry}]", float(metric[entry]), "a positive, finite number"
        )


def _cholesky(metric: np.ndarray) -> np.ndarray:
    """Lower Cholesky factors; NaN for matrices that are not finite, so that they harm no other."""
    finite = np.all(np.isfinite(metric), axis=(-2, -1))[:, None, None]
    stand_in = np.eye(metric.shape[-1])
    try:
        factor = np.linalg.cholesky(np.where(finite, metric, stand_in))
    except np.linalg.LinAlgError:
        smallest = np.min(np.linalg.eigvalsh(np.where(finite, metric, stand_in)))
        raise InvalidValueError(
            "smallest eigenvalue of metric", float(smallest), "a positive number"
        ) from None
    return np.where(finite, factor, np.nan)
