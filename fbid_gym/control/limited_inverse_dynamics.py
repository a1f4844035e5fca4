"""Inverse dynamics of a floating base whose contacts neither pull nor slip.

[M10] eq. (15) assumes that contacts hold whatever it takes. Here the desired acceleration is made
consistent with the contacts, as there; then come the contact forces within the limits that best
deliver its base wrench (`contact_forces`); the nearest consistent acceleration that needs just what
they deliver; and the torques, from the joint rows of M a + h = S^T tau + J^T lambda:

    a_0 = a - A^-1 J^T (J A^-1 J^T)^+ (J a + Jdot v)
    f = the forces nearest to (M a_0 + h)_base,   lambda = point_map f
    a = a_0 + P M_b^T (M_b P M_b^T)^+ (what they miss),   P = A^-1 - A^-1 J^T (J A^-1 J^T)^+ J A^-1
    tau = (M a + h - J^T lambda)_joints

with A the diagonal metric of "nearest" and M_b the first six rows of M. What contacts leave no
motion for, on legs of few joints, comes with P = A^-1: there the contacts give way.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fbid_gym.checks import check_positive
from fbid_gym.compiled import compiled, kernel
from fbid_gym.control.contact_forces import (
    DEFAULT_ACCURACY,
    ContactLimits,
    fitted_point_map,
    limits_in_contact,
    point_limits,
    wrench_scale,
)
from fbid_gym.control.dual_newton import Forces, Problem, deliver
from fbid_gym.control.equations import (
    bound_mobility,
    checked_equations,
    fitted,
    mobility_of,
    radius_of_gyration,
)
from fbid_gym.control.held import Held, hold, make_consistent
from fbid_gym.errors import ShapeError
from fbid_gym.quantities import Accuracy, EquationOfMotion, PointLimits, ReducedContacts
from fbid_gym.small_matrices import (
    copy,
    dot,
    factor,
    factor_damped,
    multiply,
    multiply_transposed,
    solve_factored,
    solve_factored_columns,
    times,
)

# Contacts that leave less than this share of the base wrench's free response give way instead.
_FAINT = 1e-6


class LimitedInverseDynamics(NamedTuple):
    """Torques whose contact forces respect friction and normal force limits, and what they achieve.

    Attributes:
        torque: (N, n) N·m.
        contact_force: (N, k) generalized forces of the rows of J.
        acceleration: (N, nv) the robot will have with these torques and contact forces; where
            J a + Jdot v is not zero the contacts give way. Beside limits, that is where hardly any
            motion would keep them; with a base that counts a thousand times as much as the joints,
            also where only the base could, as one flat foot on a leg of four joints.
        point_force: (N, P, 3) N, per contact point: two tangential components, then the normal one.
        residual: (N,) how far the base wrench is from the one the command asks for, per weight.
        iterations: (N,) int64, Newton steps the contact forces took.
        warm_start: (N, 6) to pass to the next call. Zero the rows of robots that were reset.
    """

    torque: np.ndarray
    contact_force: np.ndarray
    acceleration: np.ndarray
    point_force: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    warm_start: np.ndarray


def limited_inverse_dynamics(
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    jacobian: np.ndarray,
    acceleration: np.ndarray,
    jacobian_bias: np.ndarray,
    limits: ContactLimits,
    *,
    point_map: np.ndarray | None = None,
    active: np.ndarray | None = None,
    base_priority: float | np.ndarray = 1.0,
    length: float = 1.0,
    wrench_cost: Sequence[float] | np.ndarray | None = None,
    warm_start: np.ndarray | None = None,
    accuracy: Accuracy = DEFAULT_ACCURACY,
    gravity: float = 9.81,
) -> LimitedInverseDynamics:
    """Torques for a desired acceleration, with contact forces that friction and normal force allow.

    See the module. With too few contacts, down to none, the wrench and with it the momentum is what
    remains possible.

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
        base_priority: positive weight of base accelerations beside one for joints in "nearest", or
            one for each of the six. Beyond 1e6 and below 1e-6 it counts as that, see
            `orthogonal_inverse_dynamics`.
        length: m, lever arm that makes base moments comparable to forces.
        wrench_cost: six positive weights of the squared base wrench errors. Default: ones.
        warm_start: (N, 6) `warm_start` of the previous result. Default: zeros.
        accuracy: of the contact forces, see `contact_forces`.
        gravity: m/s^2, makes a weight of the mass, to which tolerance and residual are relative.

    Returns:
        LimitedInverseDynamics.

    Raises:
        ShapeError: an array does not fit.
        InvalidValueError: `base_priority`, `length`, `gravity` or `wrench_cost` is not positive and
            finite.
    """
    motion, constraint, sizes = checked_equations(mass_matrix, bias, jacobian, jacobian_bias)
    desired = fitted("acceleration", acceleration, "(N, nv)", sizes)
    check_positive(gravity=gravity)
    if point_map is None:
        if sizes["k"] % 3:
            raise ShapeError("jacobian", tuple(jacobian.shape), "k = 3 P rows without a point_map")
        point_map = np.eye(sizes["k"])[None]
    else:
        point_map = fitted_point_map(point_map, sizes)
    return limit_dynamics(
        motion,
        ReducedContacts(*constraint, point_map),
        desired,
        point_limits(limits, active, sizes["N"], point_map.shape[-1] // 3),
        mobility_of(sizes["nv"], base_priority),
        wrench_scale(length, wrench_cost),
        accuracy,
        gravity,
        fitted("warm_start", warm_start, "(N, 6)", sizes, np.zeros((sizes["N"], 6))),
    )


@kernel
def limit_dynamics(
    motion: EquationOfMotion,
    contacts: ReducedContacts,
    desired: np.ndarray,
    limits: PointLimits,
    mobility: np.ndarray,
    scale: np.ndarray,
    accuracy: Accuracy,
    gravity: float,
    start: np.ndarray,
) -> LimitedInverseDynamics:
    """The law of the module, robot by robot; `contacts.point_map` may have one row for all.

    The mobility (nv,) is the diagonal of A^-1, the scale (6,) that of `wrench_scale`.
    """
    count, rows, velocities = contacts.jacobian.shape
    columns = contacts.point_map.shape[2]
    torque, contact_force = np.empty((count, velocities - 6)), np.empty((count, rows))
    acceleration, point_force = np.empty((count, velocities)), np.empty((count, columns // 3, 3))
    residual, iterations = np.empty(count), np.empty(count, np.int64)
    warm_start = np.empty((count, 6))

    values, maps = np.empty((columns // 3, 3)), np.empty((6, columns))
    base_rows, delivered = np.empty((6, rows)), np.empty(6)
    force, wrench, missing = np.empty(velocities), np.empty(6), np.empty(6)
    held = Held(np.empty((rows, velocities)), np.empty((rows, rows)), np.empty(rows))
    bounded = mobility.copy()
    for i in range(count):
        own_map = contacts.point_map[min(i, len(contacts.point_map) - 1)]
        jacobian, mass_matrix = contacts.jacobian[i], motion.mass_matrix[i]
        bound_mobility(mobility, radius_of_gyration(mass_matrix), bounded)
        hold(jacobian, bounded, held)
        copy(desired[i], acceleration[i])
        make_consistent(held, jacobian, contacts.bias[i], acceleration[i])

        times(mass_matrix, acceleration[i], force)
        force += motion.bias[i]
        for row in range(6):
            wrench[row] = scale[row] * force[row]
            for k in range(rows):
                base_rows[row, k] = scale[row] * jacobian[k, row]
        multiply(base_rows, own_map, maps)
        limits_in_contact(limits, i, values)
        weight = gravity * mass_matrix[0, 0]
        found = Forces(point_force[i], missing, warm_start[i])
        iterations[i] = deliver(Problem(maps, wrench, values), accuracy, weight, start[i], found)
        residual[i] = np.sqrt(dot(missing, missing)) / weight
        if residual[i] != 0.0:
            for row in range(6):
                delivered[row] = missing[row] / scale[row]
            _yield_to(mass_matrix, jacobian, held, bounded, delivered, force)
            for j in range(velocities):
                acceleration[i, j] += force[j]
            times(mass_matrix, acceleration[i], force)
            force += motion.bias[i]

        times(own_map, point_force[i].reshape(columns), contact_force[i])
        for k in range(rows):
            for j in range(velocities):
                force[j] -= contact_force[i, k] * jacobian[k, j]
        copy(force[6:], torque[i])
    return LimitedInverseDynamics(
        torque, contact_force, acceleration, point_force, residual, iterations, warm_start
    )


@compiled
def _yield_to(
    mass_matrix: np.ndarray,
    jacobian: np.ndarray,
    held: Held,
    mobility: np.ndarray,
    wrench: np.ndarray,
    change: np.ndarray,
) -> None:
    """Write the least acceleration that changes the base wrench, of those that keep the contacts.

    That is P M_b^T (M_b P M_b^T)^+ wrench, see the module; and the least of all for what is left.
    The wrench (6,), N and N·m, is overwritten.
    """
    rows, velocities = jacobian.shape
    shape = velocities, 6
    free, kept, back = np.empty(shape), np.empty(shape), np.empty(shape)
    moved = np.empty((rows, 6))
    gains, inertia, lower = np.empty((6, 6)), np.empty((6, 6)), np.empty((6, 6))
    for j in range(velocities):
        for row in range(6):
            free[j, row] = mass_matrix[row, j] * mobility[j]
    multiply(jacobian, free, moved)
    solve_factored_columns(held.factor, moved)
    multiply_transposed(held.weighted, moved, back)
    for j in range(velocities):
        for row in range(6):
            kept[j, row] = free[j, row] - back[j, row]
    multiply(mass_matrix[:6], free, inertia)
    multiply(mass_matrix[:6], kept, gains)
    # Shares of what a robot without contacts would yield, so that neither units nor axes matter.
    size, share = np.empty(6), np.empty(6)
    for first in (0, 3):
        mean = (inertia[first, first] + inertia[first + 1, first + 1]) / 3.0
        size[first : first + 3] = np.sqrt(mean + inertia[first + 2, first + 2] / 3.0)
    for row in range(6):
        share[row] = wrench[row] / size[row]
        for column in range(6):
            lower[row, column] = gains[row, column] / (size[row] * size[column])
    factor_damped(lower, _FAINT)
    solve_factored(lower, share)
    share /= size
    times(kept, share, change)
    for row in range(6):
        wrench[row] -= dot(gains[row], share)
    factor(inertia)
    solve_factored(inertia, wrench)
    for j in range(velocities):
        change[j] += dot(free[j], wrench)
