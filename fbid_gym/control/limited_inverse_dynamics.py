"""Inverse dynamics of a floating base whose contacts neither pull nor slip.

[M10] eq. (15) assumes that contacts hold whatever it takes. Here the desired acceleration is made
consistent with the contacts, as there; then come the contact forces within the limits that best
deliver its base wrench (`contact_forces`); the nearest consistent acceleration that needs just what
they deliver; and the torques, from the joint rows of M a + h = S^T tau + J^T lambda:

    a_0 = a - A^-1 J^T (J A^-1 J^T)^+ (J a + Jdot v)
    f = the forces nearest to (M a_0 + h)_base,   lambda = point_map f
    a = a_0 + P M_b^T (M_b P M_b^T)^+ (what they miss),   P = A^-1 - A^-1 J^T (J A^-1 J^T)^+ J A^-1
    tau = (M a + h - J^T lambda)_joints

with A the diagonal metric of "nearest" and M_b the first six rows of M.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.control.arrays import (
    Array,
    as_flags,
    as_numpy,
    check_dynamics,
    check_shape,
    from_numpy,
)
from fbid_gym.control.contact_forces import (
    MAX_ITERATIONS,
    REGULARISATION,
    TOLERANCE,
    ContactLimits,
    all_active,
    check_contact_options,
    limit_rows,
    limits_in_contact,
    wrench_scale,
)
from fbid_gym.control.dual_newton import deliver
from fbid_gym.errors import InvalidValueError, ShapeError
from fbid_gym.small_matrices import (
    add_transposed_times,
    dot,
    factor,
    gram,
    multiply,
    multiply_transposed,
    solve_factored,
    solve_factored_columns,
    times,
)

# Added to Gram matrices of order one where the result does not depend on their null space: a
# pseudo-inverse would be the same.
_RIDGE = 1e-11
# The same for the response of the base wrench, in units of the robot's squared mass.
_RESPONSE_RIDGE = 1e-9
_GRAVITY = 9.81


class LimitedInverseDynamics(NamedTuple):
    """Torques whose contact forces respect friction and normal force limits, and what they achieve.

    Attributes:
        torque: (N, n) N m.
        contact_force: (N, k) generalized forces of the rows of J.
        acceleration: (N, nv) the robot will have with these torques and contact forces.
        point_force: (N, P, 3) N, per contact point: two tangential components, then the normal one.
        residual: (N,) how far the base wrench is from the one the command asks for, per weight.
        iterations: (N,) Newton steps the contact forces took, integers.
        warm_start: (N, 6) to pass to the next call. Zero the rows of robots that were reset.
    """

    torque: Array
    contact_force: Array
    acceleration: Array
    point_force: Array
    residual: Array
    iterations: Array
    warm_start: Array


def limited_inverse_dynamics(
    mass_matrix: Array,
    bias: Array,
    jacobian: Array,
    acceleration: Array,
    jacobian_bias: Array,
    limits: ContactLimits,
    *,
    point_map: Array | None = None,
    active: Array | None = None,
    base_priority: float = 1.0,
    length: float = 1.0,
    wrench_cost: tuple[float, ...] | None = None,
    warm_start: Array | None = None,
    regularisation: float = REGULARISATION,
    tolerance: float = TOLERANCE,
    max_iterations: int = MAX_ITERATIONS,
) -> LimitedInverseDynamics:
    """Torques for a desired acceleration, with contact forces that friction and normal force allow.

    [M10] eq. (15) assumes contacts that can pull and never slip. Here the command is made
    consistent with the contacts, as there. Then come the contact forces within the limits that best
    deliver its base wrench (M a + h)_base, the nearest consistent acceleration that needs just the
    wrench they deliver, and the torques from the joint rows of the dynamics. With too few contacts,
    down to none, the wrench and with it the momentum is what remains possible.

    Torch tensors are computed on the host, in double precision, and come back as what they were.

    Args:
        mass_matrix: (N, nv, nv) M, symmetric positive definite.
        bias: (N, nv) h.
        jacobian: (N, k, nv) J of the contact constraints; its entries of order one (SI units).
        acceleration: (N, nv) desired.
        jacobian_bias: (N, k) Jdot v.
        limits: friction and normal force limits of the points.
        point_map: (N, k, 3 P), gives the generalized forces of the rows of J from stacked point
            forces. Default: rows of J are stacked point rows, k = 3 P.
        active: (N, P) bool, points in contact; the others get zero force. Default: all.
        base_priority: positive weight of base accelerations beside one for joints in "nearest".
        length: m, lever arm that makes base moments comparable to forces.
        wrench_cost: six positive weights of the squared base wrench errors. Default: ones.
        warm_start: (N, 6) `warm_start` of the previous result. Default: zeros.
        regularisation: see `limited_contact_forces`.
        tolerance: see `limited_contact_forces`.
        max_iterations: see `limited_contact_forces`.

    Returns:
        LimitedInverseDynamics.

    Raises:
        ShapeError: an array does not fit.
        InvalidValueError: `base_priority`, `length` or `wrench_cost` is not positive and finite.
    """
    count, rows, velocities = check_dynamics(
        mass_matrix, bias, jacobian, acceleration, jacobian_bias
    )
    if not 0.0 < base_priority < np.inf:
        raise InvalidValueError("base_priority", base_priority, "a positive, finite number")
    if point_map is None:
        if rows % 3:
            raise ShapeError("jacobian", tuple(jacobian.shape), "k = 3 P rows without a point_map")
        columns, spread = rows, np.eye(rows)[None]
    else:
        columns = point_map.shape[-1]
        if columns % 3:
            raise ShapeError("point_map", tuple(point_map.shape), "3 P columns")
        check_shape("point_map", point_map, (count, rows, columns), "(N, k, 3 P)")
        spread = as_numpy(point_map)
    points = columns // 3
    check_contact_options(limits, active, warm_start, count, points)

    found = LimitedInverseDynamics(
        torque=np.empty((count, velocities - 6)),
        contact_force=np.empty((count, rows)),
        acceleration=np.empty((count, velocities)),
        point_force=np.empty((count, points, 3)),
        residual=np.empty(count),
        iterations=np.empty(count, np.int64),
        warm_start=np.empty((count, 6)),
    )
    fill_limited(
        as_numpy(mass_matrix),
        as_numpy(bias),
        as_numpy(jacobian),
        as_numpy(acceleration),
        as_numpy(jacobian_bias),
        spread,
        limit_rows(limits, points),
        all_active(points) if active is None else as_flags(active),
        np.zeros((count, 6)) if warm_start is None else as_numpy(warm_start),
        wrench_scale(length, wrench_cost),
        1.0 / base_priority,
        length,
        regularisation,
        tolerance,
        max_iterations,
        *found,
    )
    if isinstance(acceleration, np.ndarray):
        return found
    return LimitedInverseDynamics(*(from_numpy(x, like=acceleration) for x in found))


@kernel
def fill_limited(
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    jacobian: np.ndarray,
    desired: np.ndarray,
    jacobian_bias: np.ndarray,
    point_map: np.ndarray,
    limits: np.ndarray,
    active: np.ndarray,
    start: np.ndarray,
    scale: np.ndarray,
    base_mobility: float,
    length: float,
    regularisation: float,
    tolerance: float,
    budget: int,
    torque: np.ndarray,
    contact_force: np.ndarray,
    acceleration: np.ndarray,
    point_force: np.ndarray,
    residual: np.ndarray,
    iterations: np.ndarray,
    dual: np.ndarray,
) -> None:
    """The law of the module, robot by robot; the last seven arguments are to write to."""
    count, rows, velocities = jacobian.shape
    values, maps = np.empty(point_force.shape[1:]), np.empty((6, point_map.shape[2]))
    base_rows, delivered = np.empty((6, rows)), np.empty(6)
    force, wrench, missing = np.empty(velocities), np.empty(6), np.empty(6)
    held = _Held(np.empty((rows, velocities)), np.empty((rows, rows)), np.empty(rows))
    for i in range(count):
        own_map, constraint = point_map[min(i, len(point_map) - 1)], jacobian[i]
        _hold(constraint, base_mobility, held)
        acceleration[i] = desired[i]
        _make_consistent(held, constraint, jacobian_bias[i], acceleration[i])

        times(mass_matrix[i], acceleration[i], force)
        force += bias[i]
        for row in range(6):
            wrench[row] = scale[row] * force[row]
            for k in range(rows):
                base_rows[row, k] = scale[row] * constraint[k, row]
        multiply(base_rows, own_map, maps)
        limits_in_contact(limits, active, i, values)
        weight = _GRAVITY * mass_matrix[i, 0, 0]
        iterations[i] = deliver(
            maps,
            wrench,
            values,
            tolerance * weight,
            regularisation,
            budget,
            start[i],
            point_force[i],
            missing,
            dual[i],
        )
        residual[i] = np.sqrt(dot(missing, missing)) / weight
        if residual[i] != 0.0:
            delivered[:] = missing / scale
            _yield_to(mass_matrix[i], constraint, base_mobility, held, length, delivered, force)
            acceleration[i] += force
            times(mass_matrix[i], acceleration[i], force)
            force += bias[i]

        times(own_map, point_force[i].reshape(own_map.shape[1]), contact_force[i])
        contact_force[i] *= -1.0
        add_transposed_times(constraint, contact_force[i], force)
        contact_force[i] *= -1.0
        torque[i] = force[6:]


class _Held(NamedTuple):
    """What holding the contacts takes; buffers of one robot."""

    weighted: np.ndarray  # (k, nv): J A^-1
    factor: np.ndarray  # (k, k), lower half: of J A^-1 J^T
    force: np.ndarray  # (k,)


@compiled
def _hold(jacobian: np.ndarray, base_mobility: float, held: _Held) -> None:
    """Fill `held` for a Jacobian (k, nv); A^-1 has base_mobility for the base, 1 for joints."""
    for k in range(len(jacobian)):
        for j in range(jacobian.shape[1]):
            held.weighted[k, j] = jacobian[k, j] * (base_mobility if j < 6 else 1.0)
    gram(held.weighted, jacobian, _RIDGE, held.factor)
    factor(held.factor)


@compiled
def _make_consistent(
    held: _Held, jacobian: np.ndarray, jacobian_bias: np.ndarray, acceleration: np.ndarray
) -> None:
    """Change an acceleration (nv,) as little as the contacts demand, [M10] eq. (4)."""
    times(jacobian, acceleration, held.force)
    for k in range(len(held.force)):
        held.force[k] = -(held.force[k] + jacobian_bias[k])
    solve_factored(held.factor, held.force)
    add_transposed_times(held.weighted, held.force, acceleration)


@compiled
def _yield_to(
    mass_matrix: np.ndarray,
    jacobian: np.ndarray,
    base_mobility: float,
    held: _Held,
    length: float,
    wrench: np.ndarray,
    change: np.ndarray,
) -> None:
    """Write the least acceleration that keeps the contacts and changes the base wrench.

    That is P M_b^T (M_b P M_b^T)^+ wrench, see the module.

    Args:
        mass_matrix: (nv, nv).
        jacobian: (k, nv).
        base_mobility: of A^-1.
        held: of the Jacobian.
        length: m, lever arm that makes moments comparable to forces.
        wrench: (6,) N, N m; overwritten.
        change: (nv,) to write to.
    """
    rows, velocities = jacobian.shape
    response, moved = np.empty((velocities, 6)), np.empty((rows, 6))
    back, inertia = np.empty((velocities, 6)), np.empty((6, 6))
    for j in range(velocities):
        for row in range(6):
            response[j, row] = mass_matrix[row, j] * (base_mobility if j < 6 else 1.0)
    multiply(jacobian, response, moved)
    solve_factored_columns(held.factor, moved)
    multiply_transposed(held.weighted, moved, back)
    response -= back
    multiply(mass_matrix[:6], response, inertia)
    ridge = _RESPONSE_RIDGE * mass_matrix[0, 0] ** 2
    for row in range(6):
        inertia[row, row] += ridge if row < 3 else ridge * length**2
    factor(inertia)
    solve_factored(inertia, wrench)
    times(response, wrench, change)
