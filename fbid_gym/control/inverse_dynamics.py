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
underactuated. Forces and moments on the base are compared at its radius of gyration, so that
nothing here depends on the unit of length.

Velocities are base first, v = [base (6), joints (n)], nv = 6 + n; M, h, J and accelerations are in
the same coordinates. k counts the rows of J; all-zero rows and k = 0 are fine (flight).
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.checks import positive_numbers
from fbid_gym.compiled import compiled, kernel
from fbid_gym.control.equations import (
    bound_mobility,
    checked_equations,
    fitted,
    mobility_of,
    radius_of_gyration,
)
from fbid_gym.quantities import Constraint, EquationOfMotion
from fbid_gym.small_matrices import (
    add_transposed_times,
    dot,
    gram,
    invert,
    multiply,
    multiply_transposed,
    pseudo_inverse,
    times,
)

# Singular values of J at or below a thousandth of the largest are treated as absent: what two flat
# feet on legs of five joints cannot do at home, they can hardly do when they have moved a little.
_CONTACT_RTOL = 1e-6
_WEIGHTED_RTOL = 1e-10  # of what is left, with weights that may be far from each other
# Contacts whose shortest lever arm is below a thousandth of the longest count as a line or a point:
# taking them for more would buy a moment with a thousandfold force.
_BASE_RTOL = 1e-6
_REGULAR_RTOL = 1e-13  # of a matrix that is regular but for rounding
# Weights of the base farther from each other would hide what its contacts can push.
_UNEVEN = 1e3


class InverseDynamics(NamedTuple):
    """Torques, and what they achieve if the contacts hold.

    Attributes:
        torque: (N, n) N·m, the least in the torque cost.
        contact_force: (N, k) generalized forces lambda of the rows of J, [M10] eq. (17); the least
            in norm where rows are redundant.
        acceleration: (N, nv) the robot will really have: the command, made consistent with the
            contacts and, if underactuated, achievable.
        rank: (N,) int64, of J.
        underactuation: (N,) int64, base directions out of six that no contact force can push.
        residual: (N,) by how much the base rows of M a + h = J^T lambda are missed, as a share of
            their summands; rounding, unless the problem's numbers are too far apart for that.
    """

    torque: np.ndarray
    contact_force: np.ndarray
    acceleration: np.ndarray
    rank: np.ndarray
    underactuation: np.ndarray
    residual: np.ndarray


def orthogonal_inverse_dynamics(
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    jacobian: np.ndarray,
    acceleration: np.ndarray,
    jacobian_bias: np.ndarray,
    *,
    torque_cost: np.ndarray | None = None,
    base_priority: float | np.ndarray = 1.0,
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
        base_priority: positive weight of base accelerations beside one for joints, or one for each
            of the six. Beyond 1e6 and below 1e-6 it counts as that, of shifts at the robot's radius
            of gyration: the base first, and the base last, in effect.

    Returns:
        InverseDynamics.

    Raises:
        ShapeError: an array does not fit.
        InvalidValueError: `torque_cost` or `base_priority` is not positive and finite.
    """
    motion, constraint, sizes = checked_equations(mass_matrix, bias, jacobian, jacobian_bias)
    desired = fitted("acceleration", acceleration, "(N, nv)", sizes)
    cost = np.empty((0, sizes["n"]))
    if torque_cost is not None:
        axes = "(n,)" if torque_cost.shape == (sizes["n"],) else "(N, n)"
        cost = np.atleast_2d(fitted("torque_cost", torque_cost, axes, sizes))
        positive_numbers("torque_cost", cost.ravel(), cost.size)
    mobility = mobility_of(sizes["nv"], base_priority)
    return invert_dynamics(motion, constraint, desired, cost, mobility)


@kernel
def invert_dynamics(
    motion: EquationOfMotion,
    constraint: Constraint,
    desired: np.ndarray,
    torque_cost: np.ndarray,
    mobility: np.ndarray,
) -> InverseDynamics:
    """The law of the module, robot by robot.

    The torque cost is the diagonal of W, (N, n) or (1, n), (0, n) for ones; the mobility, one over
    the weights of accelerations, that of A^-1, (nv,).
    """
    count, rows, velocities = constraint.jacobian.shape
    joints = velocities - 6
    torque, contact_force = np.empty((count, joints)), np.empty((count, rows))
    acceleration = desired.copy()
    rank, underactuation = np.empty(count, np.int64), np.empty(count, np.int64)
    residual = np.empty(count)

    even, bounded, most_joint = np.ones((1, joints)), mobility.copy(), 0.0
    for j in range(6, velocities):
        most_joint = max(most_joint, mobility[j])
    weighted, by_cost = np.empty((rows, velocities)), np.empty((rows, velocities))
    product, inverse = np.empty((rows, rows)), np.empty((rows, rows))
    cost_inverse, error = np.empty((rows, rows)), np.empty(rows)
    base, spread, given = np.empty((rows, 6)), np.empty((rows, 6)), np.empty(6)
    push, push_inverse, missing = np.empty((6, 6)), np.empty((6, 6)), np.empty(6)
    force = np.empty(velocities)
    for i in range(count):
        jacobian, bias, own = constraint.jacobian[i], constraint.bias[i], acceleration[i]
        own_motion = EquationOfMotion(motion.mass_matrix[i], motion.bias[i])
        arm = radius_of_gyration(own_motion.mass_matrix)
        least_base, most_base = bound_mobility(mobility, arm, bounded)
        push_rtol = _BASE_RTOL * min(1.0, least_base)
        _gram_by(jacobian, bounded, weighted, product)
        rank[i], condition = invert(product, inverse)
        most = max(most_base, most_joint) * arm**2
        if not (condition < 1.0 / _WEIGHTED_RTOL and _holds(jacobian, arm, inverse, most)):
            jacobian, bias, cut = _firm(jacobian, bias, arm)
            if cut or not condition < 1.0 / _WEIGHTED_RTOL:
                _gram_by(jacobian, bounded, weighted, product)
                rank[i] = pseudo_inverse(product, _WEIGHTED_RTOL, inverse)

        # The nearest acceleration with J a + Jdot v = 0, [M10] eq. (4).
        for k in range(rows):
            error[k] = -(dot(jacobian[k], own) + bias[k])
        times(inverse, error, contact_force[i])
        add_transposed_times(weighted, contact_force[i], own)

        # X of the module: shared with the projection unless the torque cost differs from its
        # metric, or that of the base is too uneven to see by it what contacts can push.
        least, cost = inverse, weighted
        if len(torque_cost) > 0 or most_base > _UNEVEN * least_base:
            costs = torque_cost if len(torque_cost) > 0 else even
            entries = costs[min(i, len(costs) - 1)]
            mean = entries.mean() if joints > 0 else 1.0
            for k in range(rows):
                for j in range(velocities):
                    weight = mean * arm**2 if j < 3 else mean if j < 6 else entries[j - 6]
                    by_cost[k, j] = jacobian[k, j] * weight
            gram(by_cost, jacobian, 0.0, product)
            pseudo_inverse(product, _WEIGHTED_RTOL, cost_inverse)
            least, cost, push_rtol = cost_inverse, by_cost, _BASE_RTOL
        for k in range(rows):
            for row in range(6):
                base[k, row] = jacobian[k, row] / (1.0 if row < 3 else arm)
        multiply(least, base, spread)
        multiply_transposed(base, spread, push)
        underactuation[i] = 6 - pseudo_inverse(push, push_rtol, push_inverse)
        if underactuation[i] > 0:
            held = _Held(weighted, inverse, push, push_inverse)
            _make_achievable(own_motion, held, bounded, arm, own)

        times(motion.mass_matrix[i], own, force)
        force += motion.bias[i]
        times(cost, force, error)
        for row in range(6):
            missing[row] = force[row] / (1.0 if row < 3 else arm)
        for k in range(rows):
            for row in range(6):
                missing[row] -= spread[k, row] * error[k]
        times(least, error, contact_force[i])
        times(push_inverse, missing, given)
        for k in range(rows):
            contact_force[i, k] += dot(spread[k], given)
        for k in range(rows):
            for j in range(velocities):
                force[j] -= contact_force[i, k] * jacobian[k, j]
        torque[i] = force[6:]
        residual[i] = _backward_error(own_motion, own, jacobian, contact_force[i], force)
    return InverseDynamics(torque, contact_force, acceleration, rank, underactuation, residual)


@compiled
def _gram_by(
    jacobian: np.ndarray, weights: np.ndarray, weighted: np.ndarray, product: np.ndarray
) -> None:
    """Write J A^-1 (k, nv) and the lower half of J A^-1 J^T (k, k), A^-1 the diagonal `weights`."""
    for k in range(len(jacobian)):
        for j in range(len(weights)):
            weighted[k, j] = jacobian[k, j] * weights[j]
    gram(weighted, jacobian, 0.0, product)


@compiled
def _holds(jacobian: np.ndarray, arm: float, inverse: np.ndarray, most: float) -> bool:
    """Return whether it is certain that the contacts hold in all directions, see `_firm`.

    Args:
        jacobian: J (k, nv).
        arm: m, the radius of gyration.
        inverse: (k, k) of J A^-1 J^T.
        most: the largest entry of A^-1, as a multiple of that of motions which count by what they
            move at `arm`.
    """
    # A singular value squared is no larger than all of them together, and by the even weights at
    # least 1 / most of what it is by A^-1.
    shifts, turns, largest = 0.0, 0.0, 0.0
    for k in range(len(jacobian)):
        shifts += dot(jacobian[k, :3], jacobian[k, :3])
        turns += dot(jacobian[k, 3:], jacobian[k, 3:])
        largest += inverse[k, k]
    return (shifts + turns / arm**2) * largest * most < 1.0 / _CONTACT_RTOL


@compiled
def _firm(
    jacobian: np.ndarray, bias: np.ndarray, arm: float
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Return J (k, nv) and Jdot v (k,) without directions in which contacts hardly hold, if any.

    Which these are is a property of the contacts, whatever weighs how much: motions count by what
    they move at the radius of gyration, `arm` (m). Last comes whether there are any.
    """
    rows = len(jacobian)
    product, scratch = np.empty((rows, rows)), np.empty((rows, rows))
    even = np.full(jacobian.shape[1], 1.0 / arm**2)
    even[:3] = 1.0
    _gram_by(jacobian, even, np.empty_like(jacobian), product)
    _, condition = invert(product, scratch)
    if condition < 1.0 / _CONTACT_RTOL or not np.isfinite(product.sum()):
        return jacobian, bias, False
    values, vectors = np.linalg.eigh(product)
    firm, firm_bias, along = np.zeros_like(jacobian), np.zeros(rows), np.empty(jacobian.shape[1])
    for k in range(rows):
        if values[k] > _CONTACT_RTOL * values[-1]:
            along[:] = 0.0
            change = 0.0
            for row in range(rows):
                change += vectors[row, k] * bias[row]
                for j in range(len(along)):
                    along[j] += vectors[row, k] * jacobian[row, j]
            for row in range(rows):
                firm_bias[row] += vectors[row, k] * change
                for j in range(len(along)):
                    firm[row, j] += vectors[row, k] * along[j]
    return firm, firm_bias, True


@compiled
def _backward_error(
    motion: EquationOfMotion,
    acceleration: np.ndarray,
    jacobian: np.ndarray,
    contact_force: np.ndarray,
    missing: np.ndarray,
) -> float:
    """Largest of the base rows of M a + h - J^T lambda, each as a share of its summands' sizes.

    `missing` (nv,) is that difference.
    """
    largest = 0.0
    for row in range(6):
        size = abs(motion.bias[row])
        for j in range(len(acceleration)):
            size += abs(motion.mass_matrix[row, j] * acceleration[j])
        for k in range(len(contact_force)):
            size += abs(jacobian[k, row] * contact_force[k])
        if not np.isfinite(size):
            return np.nan
        if size > 0.0:
            largest = max(largest, abs(missing[row]) / size)
    return largest


class _Held(NamedTuple):
    """The contacts of one robot."""

    weighted: np.ndarray  # (k, nv): J A^-1
    inverse: np.ndarray  # (k, k): (J A^-1 J^T)^+
    push: np.ndarray  # (6, 6), N and N·m at the radius of gyration,
    push_inverse: np.ndarray  # (6, 6): their product projects onto what contacts can push


@compiled
def _make_achievable(
    motion: EquationOfMotion,
    held: _Held,
    mobility: np.ndarray,
    arm: float,
    acceleration: np.ndarray,
) -> None:
    """Change an acceleration (nv,) as little as it takes to need no wrench beyond the contacts.

    It keeps the contacts: with P = A^-1 - A^-1 J^T (J A^-1 J^T)^+ J A^-1 the change is P M_b^T u,
    M_b the base rows of M. The mobility (nv,) is the diagonal of A^-1, `arm` (m) the radius of
    gyration.
    """
    rows, velocities = held.weighted.shape
    beyond, through = np.empty((6, 6)), np.empty((6, 6))
    multiply(held.push, held.push_inverse, beyond)
    for i in range(6):
        for j in range(6):
            beyond[i, j] = (1.0 if i == j else 0.0) - beyond[i, j]
    columns, response = np.empty((velocities, 6)), np.empty((velocities, 6))
    wanted, change = np.empty(6), np.empty(6)
    for row in range(6):
        lever = 1.0 if row < 3 else arm
        change[row] = dot(motion.mass_matrix[row], acceleration) + motion.bias[row]
        change[row] /= lever
        for j in range(velocities):
            columns[j, row] = motion.mass_matrix[row, j] / lever
            response[j, row] = columns[j, row] * mobility[j]
    times(beyond, change, wanted)

    moved, forces, back = np.empty((rows, 6)), np.empty((rows, 6)), np.empty((velocities, 6))
    multiply(held.weighted, columns, moved)
    multiply(held.inverse, moved, forces)
    inertia, regular = np.empty((6, 6)), np.empty((6, 6))
    multiply_transposed(columns, response, inertia)
    size = 0.0
    for i in range(6):
        size += inertia[i, i] / 6.0
    multiply_transposed(held.weighted, forces, back)
    response -= back
    multiply_transposed(columns, response, inertia)
    multiply(beyond, inertia, through)
    multiply(through, beyond, regular)
    # Regular although `beyond` is not: what a robot in flight has stands in for the directions left
    # out.
    for i in range(6):
        for j in range(6):
            regular[i, j] += size * ((1.0 if i == j else 0.0) - beyond[i, j])
    pseudo_inverse(regular, _REGULAR_RTOL, inertia)
    times(inertia, wanted, change)
    times(beyond, change, wanted)
    for j in range(velocities):
        acceleration[j] -= dot(response[j], wanted)
