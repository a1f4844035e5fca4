"""Inverse dynamics of a floating base in contact, by orthogonal decomposition.

[M10] eqs. (9)-(17) project the dynamics M a + h = S^T tau + J^T lambda onto the motions that the
contacts leave free and take the smallest torque there. The same torque is the solution of

    minimise  tau^T W tau   over tau, lambda   subject to   M a + h = S^T tau + J^T lambda,

and that form needs no QR factorisation, does not care whether rows of J repeat or vanish, and
serves the friction-limited law as well. With b = M a + h, W' = blkdiag(rho I, W), G = J_base^T and
X = (J W' J^T)^+ its solution is

    nu = (G X G^T)^+ (b_base - G X J W' b)
    lambda = X (J W' b + G^T nu)
    tau = (b - J^T lambda)_joints

for any rho > 0; lambda is the smallest that belongs to tau. G X G^T has the rank of the base
columns of J: six if the contacts can push the base in every direction, less if the robot is
underactuated.

Velocities are base first, v = [base (6), joints (n)], nv = 6 + n; M, h, J and accelerations are in
the same coordinates. k counts the rows of J; all-zero rows and k = 0 are fine (flight).
"""

from functools import lru_cache
from types import ModuleType
from typing import Any, NamedTuple

from fbid_gym.control.arrays import (
    Array,
    check_dynamics,
    check_shape,
    identity,
    matvec,
    namespace,
)
from fbid_gym.control.pseudo_inverse import symmetric_pseudo_inverse
from fbid_gym.errors import InvalidValueError

# Singular values of J at or below 1e-5 of the largest are treated as absent.
_CONTACT_RTOL = 1e-10
# Contacts whose shortest lever arm is below a thousandth of the longest count as a line or a point:
# taking them for more would buy a moment with a thousandfold force.
_BASE_RTOL = 1e-6


class InverseDynamics(NamedTuple):
    """Torques, and what they achieve if the contacts hold.

    Attributes:
        torque: (N, n) N m, the least in the torque cost.
        contact_force: (N, k) generalized forces lambda of the rows of J, [M10] eq. (17); the least
            in norm where rows are redundant.
        acceleration: (N, nv) the robot will really have: the command, made consistent with the
            contacts and, if underactuated, achievable.
        rank: (N,) rank of J, integers.
        underactuation: (N,) base directions out of six that no contact force can push, integers.
    """

    torque: Array
    contact_force: Array
    acceleration: Array
    rank: Array
    underactuation: Array


def orthogonal_inverse_dynamics(
    mass_matrix: Array,
    bias: Array,
    jacobian: Array,
    acceleration: Array,
    jacobian_bias: Array,
    *,
    torque_cost: Array | None = None,
    base_priority: float = 1.0,
) -> InverseDynamics:
    """Torques that realise a desired acceleration with the least torque, [M10] eq. (15).

    The command is first replaced by the nearest acceleration that the contacts allow,
    J a + Jdot v = 0, and, if the robot is underactuated, by the nearest of those it can achieve:
    with fewer contacts than it takes to hold the base, some momenta are beyond its reach, in flight
    all six. "Nearest" weighs squared base accelerations by `base_priority` and squared joint
    accelerations by one.

    Args:
        mass_matrix: (N, nv, nv) M, symmetric positive definite.
        bias: (N, nv) h, Coriolis, centrifugal and gravity forces.
        jacobian: (N, k, nv) J of the contact constraints.
        acceleration: (N, nv) desired.
        jacobian_bias: (N, k) Jdot v.
        torque_cost: (n,) or (N, n) positive diagonal of W in [M10] eq. (16): a larger entry makes
            the joint do less. Default: ones.
        base_priority: positive weight of base accelerations beside one for joints.

    Returns:
        InverseDynamics.

    Raises:
        ShapeError: an array does not fit.
        InvalidValueError: `base_priority` is not positive and finite.
    """
    count, _, velocities = check_dynamics(mass_matrix, bias, jacobian, acceleration, jacobian_bias)
    inverse_metric = _inverse_metric(base_priority, velocities, jacobian)
    weighted = jacobian if inverse_metric is None else jacobian * inverse_metric
    inverse, rank = symmetric_pseudo_inverse(weighted @ jacobian.mT, _CONTACT_RTOL)
    acceleration = consistent_acceleration(
        acceleration, weighted, matvec(jacobian, acceleration) + jacobian_bias, inverse
    )

    gram = inverse  # X, shared with the projection unless the torque cost differs from its metric
    xp = namespace(jacobian)
    if torque_cost is not None:
        check_shape(
            "torque_cost", torque_cost, (count, velocities - 6)[2 - torque_cost.ndim :], "(N, n)"
        )
        torque_cost = xp.broadcast_to(torque_cost, (count, velocities - 6))
        scale = xp.mean(torque_cost, axis=-1, keepdims=True)
        cost = xp.concat([xp.broadcast_to(scale, (count, 6)), torque_cost], axis=-1)
        weighted_by_cost = jacobian * cost[:, None, :]
        gram, _ = symmetric_pseudo_inverse(weighted_by_cost @ jacobian.mT, _CONTACT_RTOL)
    else:
        weighted_by_cost = weighted
    base = jacobian[:, :, :6]
    spread = gram @ base
    push = base.mT @ spread
    push_inverse, push_rank = symmetric_pseudo_inverse(push, _BASE_RTOL / max(1.0, base_priority))
    underactuation = 6 - push_rank
    if underactuation.any():
        rows = xp.nonzero(underactuation)[0]
        beyond = identity(6, push) - push[rows] @ push_inverse[rows]
        acceleration[rows] = achievable_acceleration(
            acceleration[rows],
            mass_matrix[rows],
            bias[rows],
            free_response(mass_matrix[rows, :6, :], weighted[rows], inverse[rows], inverse_metric),
            beyond,
        )

    force = matvec(mass_matrix, acceleration) + bias
    projected = matvec(weighted_by_cost, force)
    missing = force[:, :6] - matvec(spread.mT, projected)
    contact_force = matvec(gram, projected) + matvec(spread, matvec(push_inverse, missing))
    torque = (force - matvec(jacobian.mT, contact_force))[:, 6:]
    return InverseDynamics(torque, contact_force, acceleration, rank, underactuation)


def consistent_acceleration(
    acceleration: Array, weighted_jacobian: Array, error: Array, gram_inverse: Array
) -> Array:
    """Nearest acceleration with J a + Jdot v = 0 ([M10] eq. (4)).

    Args:
        acceleration: (N, nv) desired.
        weighted_jacobian: (N, k, nv) J A^-1, A the diagonal metric of "nearest".
        error: (N, k) J a + Jdot v of the desired acceleration.
        gram_inverse: (N, k, k) (J A^-1 J^T)^+.

    Returns:
        (N, nv).
    """
    return acceleration - matvec(weighted_jacobian.mT, matvec(gram_inverse, error))


def free_response(
    base_rows: Array, weighted_jacobian: Array, gram_inverse: Array, inverse_metric: Array | None
) -> Array:
    """Contact-consistent accelerations P M_b^T that change the base wrench.

    P = A^-1 - A^-1 J^T (J A^-1 J^T)^+ J A^-1 projects onto the null space of J in the metric A.

    Args:
        base_rows: (N, 6, nv) M_b, the first six rows of M.
        weighted_jacobian: (N, k, nv) J A^-1.
        gram_inverse: (N, k, k) (J A^-1 J^T)^+.
        inverse_metric: (nv,) diagonal of A^-1, None for ones.

    Returns:
        (N, nv, 6).
    """
    columns = base_rows.mT
    held = weighted_jacobian.mT @ (gram_inverse @ (weighted_jacobian @ columns))
    return (columns if inverse_metric is None else inverse_metric[:, None] * columns) - held


def achievable_acceleration(
    acceleration: Array, mass_matrix: Array, bias: Array, response: Array, beyond: Array
) -> Array:
    """Nearest contact-consistent acceleration that needs no wrench the contacts cannot deliver.

    Args:
        acceleration: (N, nv) consistent with the contacts.
        mass_matrix: (N, nv, nv).
        bias: (N, nv).
        response: (N, nv, 6) of `free_response`.
        beyond: (N, 6, 6) orthogonal projector onto the base directions no contact can push.

    Returns:
        (N, nv), with beyond (M a + h)_base = 0.
    """
    base_rows = mass_matrix[:, :6, :]
    wanted = matvec(base_rows, acceleration) + bias[:, :6]
    inertia = base_rows @ response
    # Regular although `beyond` is not: the identity stands in for the directions left out.
    regular = beyond @ inertia @ beyond + (identity(6, beyond) - beyond)
    xp = namespace(acceleration)
    change = xp.linalg.solve(regular, matvec(beyond, wanted)[..., None])
    return acceleration - (response @ (beyond @ change))[..., 0]


def _inverse_metric(base_priority: float, velocities: int, like: Array) -> Array | None:
    """(nv,) diagonal of the inverse metric of accelerations; None stands for ones."""
    if base_priority == 1.0:
        return None
    return _metric_array(base_priority, velocities, namespace(like), like.dtype, like.device)


@lru_cache(maxsize=64)
def _metric_array(
    base_priority: float, velocities: int, xp: ModuleType, dtype: Any, device: Any
) -> Array:
    if not 0.0 < base_priority < float("inf"):
        raise InvalidValueError("base_priority", base_priority, "a positive, finite number")
    entries = [1.0 / base_priority] * 6 + [1.0] * (velocities - 6)
    return xp.asarray(entries, dtype=dtype, device=device)
