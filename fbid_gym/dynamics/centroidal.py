"""Inertially decoupled dynamics of a floating base: momentum and joints as velocities, [G15].

With the centroidal momentum h = A v (linear, then angular about the centre of mass, world axes)
and the joint velocities as coordinates, xi = [h; qdot] = A_Q v, the mass matrix falls apart into
1/m, Lambda_l and Lambda_q ([G15] eqs. (12)-(28)). Everything needed for that stands in the first
six rows of M. With R the base's rotation, c the centre of mass seen from the base and

    P = [[E, 0], [-skew(c), R]],

which takes a generalized force on the base in MuJoCo's coordinates (force in world axes, moment
about the base in base axes) to a wrench at the centre of mass in world axes,

    A = P M[:6]        P M[:6, :6] P^T = blkdiag(m E, I_c)        Lambda_h = blkdiag(E / m, I_c^-1)
    A_Q^-1 = [[P^T Lambda_h, -P^T Lambda_h A_q], [0, E]]

with I_c the inertia of the robot about its centre of mass, joints locked, and A_q the joint columns
of A. One 3x3 inverse is all it takes. [G15] writes v with the base's angular velocity in any frame;
v is MuJoCo's here (see `DynamicsTerms`), and xi, h, Lambda and Gamma do not depend on that choice.

The joints' armature is part of Lambda_q. Armature on the free joint has no place in the theory: it
makes M unlike that of any rigid bodies, and none of the propositions hold.

N robots, nv = 6 + n. What runs at every control tick is compiled.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.checks import check_shape, contiguous
from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.frames import skew
from fbid_gym.errors import ShapeError
from fbid_gym.quantities import CentroidalTerms, DynamicsTerms
from fbid_gym.small_matrices import copy, multiply, multiply_by_transpose, times

GRAVITY = (0.0, 0.0, -9.81)
"""m/s^2, world."""


class DecoupledDynamics(NamedTuple):
    """[G15] eq. (25) with its coordinates: Lambda xi_dot + Gamma xi + gravity = forces.

    Attributes:
        transform: (N, nv, nv) A_Q of eq. (12), xi = A_Q v.
        inverse_transform: (N, nv, nv) A_Q^-1 of eq. (13).
        transform_rate: (N, nv, nv) time derivative of A_Q.
        inertia: (N, nv, nv) Lambda, block diagonal: E / m, Lambda_l, Lambda_q.
        coriolis: (N, nv, nv) Gamma of eqs. (15), (18), (25).
    """

    transform: np.ndarray
    inverse_transform: np.ndarray
    transform_rate: np.ndarray
    inertia: np.ndarray
    coriolis: np.ndarray


def centroidal_terms(terms: DynamicsTerms, velocity: np.ndarray) -> CentroidalTerms:
    """Return the centroidal momentum and the matrices around it.

    This is all that a control tick needs of [G15].

    Args:
        terms: the dynamics of N robots without armature on their free joints.
        velocity: (N, nv) their generalized velocities.

    Raises:
        ShapeError: an array does not fit.
    """
    shape = tuple(velocity.shape)
    if len(shape) != 2 or shape[1] < 6:
        raise ShapeError("velocity", shape, "(N, nv) with nv of at least 6")
    count, size = shape
    check_shape("mass_matrix", terms.mass_matrix, (count, size, size), "(N, nv, nv)")
    check_shape("base_position", terms.base_position, (count, 3), "(N, 3)")
    check_shape("world_from_base", terms.world_from_base, (count, 3, 3), "(N, 3, 3)")
    check_shape("com", terms.com, (count, 3), "(N, 3)")
    return find_centroidal_terms(DynamicsTerms(*map(contiguous, terms)), contiguous(velocity))


@kernel
def find_centroidal_terms(terms: DynamicsTerms, velocity: np.ndarray) -> CentroidalTerms:
    """Return the centroidal momentum (N, 6) at velocities (N, nv), and the matrices around it."""
    count, size = velocity.shape
    matrix, momentum, mass = np.empty((count, 6, size)), np.empty((count, 6)), np.empty(count)
    inertia, inverse_inertia = np.empty((count, 3, 3)), np.empty((count, 3, 3))
    to_com, wrench_map = np.empty((count, 6, 6)), np.empty((count, size, 6))
    for robot in range(count):
        change, ours, inverse = to_com[robot], matrix[robot], inverse_inertia[robot]
        _fill_base_force_to_com(
            terms.base_position[robot], terms.world_from_base[robot], terms.com[robot], change
        )
        multiply(change, terms.mass_matrix[robot, :6], ours)
        multiply_by_transpose(ours[3:, :6], change[3:], inertia[robot])
        _invert(inertia[robot], inverse)
        mass[robot] = terms.mass_matrix[robot, 0, 0]
        times(ours, velocity[robot], momentum[robot])
        for column in range(size):
            row = wrench_map[robot, column]
            for axis in range(3):
                row[axis] = ours[axis, column] / mass[robot]
                row[3 + axis] = 0.0
                for other in range(3):
                    row[3 + axis] += ours[3 + other, column] * inverse[other, axis]
    return CentroidalTerms(matrix, momentum, mass, inertia, inverse_inertia, to_com, wrench_map)


@compiled
def _fill_base_force_to_com(
    position: np.ndarray, rotation: np.ndarray, com: np.ndarray, result: np.ndarray
) -> None:
    """Write the matrix P of the module to `result` (6, 6)."""
    result[:] = 0.0
    for axis in range(3):
        after, last = (axis + 1) % 3, (axis + 2) % 3
        result[axis, axis] = 1.0
        result[3 + after, last] = com[axis] - position[axis]
        result[3 + last, after] = position[axis] - com[axis]
        copy(rotation[axis], result[3 + axis, 3:])


@compiled
def _invert(matrix: np.ndarray, result: np.ndarray) -> None:
    """The inverse of a matrix (3, 3), by cofactors."""
    for i in range(3):
        for j in range(3):
            a, b, c, d = (j + 1) % 3, (j + 2) % 3, (i + 1) % 3, (i + 2) % 3
            result[i, j] = matrix[a, c] * matrix[b, d] - matrix[a, d] * matrix[b, c]
    determinant = 0.0
    for i in range(3):
        determinant += matrix[0, i] * result[i, 0]
    for i in range(3):
        for j in range(3):
            result[i, j] /= determinant


def momentum_rate_bias(
    body: CentroidalTerms, bias: np.ndarray, gravity: tuple[float, float, float] = GRAVITY
) -> np.ndarray:
    """Return the rate of the momentum at vdot = 0, Adot v: (N, 6) N and N·m.

    By [G15] eq. (6) the momentum's rate A vdot + Adot v is the sum of the external wrenches,
    gravity's included. The first six rows of the equations of motion say the same with the bias
    force, so no derivative of A is needed.

    Args:
        body: of the robots.
        bias: (N, nv) `DynamicsTerms.bias`.
        gravity: m/s^2, world, the one in `bias`.
    """
    result = np.matvec(body.to_com, bias[:, :6])
    result[:, :3] += np.array(gravity) * body.mass[:, None]
    return result


def momentum_inertia(body: CentroidalTerms) -> np.ndarray:
    """Return Lambda_h = blkdiag(E / m, Lambda_l) of [G15] eqs. (16), (22), (28): (N, 6, 6)."""
    inverse = body.inverse_inertia
    result = np.zeros((len(inverse), 6, 6))
    result[:, 0, 0] = result[:, 1, 1] = result[:, 2, 2] = 1.0 / body.mass
    result[:, 3:, 3:] = inverse
    return result


def transform(body: CentroidalTerms) -> tuple[np.ndarray, np.ndarray]:
    """Return A_Q and its inverse, [G15] eqs. (12), (13): (N, nv, nv) each."""
    matrix = body.matrix
    count, _, size = matrix.shape
    forward, inverse = np.tile(np.eye(size), (2, count, 1, 1))
    forward[:, :6] = matrix
    base = body.to_com.mT @ momentum_inertia(body)
    inverse[:, :6, :6] = base
    inverse[:, :6, 6:] = -(base @ matrix[:, :, 6:])
    return forward, inverse


def transformed_jacobian(body: CentroidalTerms, jacobian: np.ndarray) -> np.ndarray:
    """Return Jbar = J A_Q^-1 of [G15] eq. (25).

    Its first six columns act on the momentum (Jbar_b), the others on the joints (Jbar_q).

    Args:
        body: of the robots.
        jacobian: (N, k, nv) with respect to v.

    Returns:
        (N, k, nv) with respect to xi.
    """
    base = jacobian[:, :, :6] @ body.to_com.mT @ momentum_inertia(body)
    joints = jacobian[:, :, 6:] - base @ body.matrix[:, :, 6:]
    return np.concatenate((base, joints), axis=-1)


def generalized_jacobian(mass_matrix: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
    """Return the generalized Jacobian of a free-floating robot, [G15] eq. (33).

    At zero momentum the velocity of the end effector is this times qdot (Umetani and Yoshida 1987).
    It equals the joint columns of `transformed_jacobian`.

    Args:
        mass_matrix: (N, nv, nv).
        jacobian: (N, k, nv).

    Returns:
        (N, k, n).
    """
    base = np.linalg.solve(mass_matrix[:, :6, :6], mass_matrix[:, :6, 6:])
    return jacobian[:, :, 6:] - jacobian[:, :, :6] @ base


def joint_inertia(body: CentroidalTerms, mass_matrix: np.ndarray) -> np.ndarray:
    """Return Lambda_q = M_qq - A_q^T Lambda_h A_q of [G15] eq. (17): (N, n, n).

    The inertia that motor torques feel on a robot in flight.
    """
    joints = body.matrix[:, :, 6:]
    return mass_matrix[:, 6:, 6:] - body.wrench_map[:, 6:] @ joints


def kinetic_energy(
    body: CentroidalTerms, mass_matrix: np.ndarray, velocity: np.ndarray
) -> np.ndarray:
    """Return the kinetic energy of linear momentum, angular momentum and joints, [G15] eq. (34).

    Returns:
        (N, 3) J.
    """
    linear, angular = body.momentum[:, :3], body.momentum[:, 3:]
    joints = velocity[:, 6:]
    parts = (
        np.vecdot(linear, linear) / body.mass,
        np.vecdot(angular, np.matvec(body.inverse_inertia, angular)),
        np.vecdot(joints, np.matvec(joint_inertia(body, mass_matrix), joints)),
    )
    return 0.5 * np.stack(parts, axis=-1)


def momentum_matrix_rate(
    body: CentroidalTerms, terms: DynamicsTerms, velocity: np.ndarray, coriolis: np.ndarray
) -> np.ndarray:
    """Return the time derivative of A: (N, 6, nv).

    Args:
        body: of the robots.
        terms: of the robots.
        velocity: (N, nv).
        coriolis: (N, nv, nv) any C with Mdot - 2 C skew, so that Mdot = C + C^T.
    """
    mass_rate = coriolis[:, :6] + coriolis[:, :, :6].mT
    turn = np.zeros_like(body.to_com)
    turn[:, 3:, :3] = skew(velocity[:, :3] - terms.com_velocity)
    turn[:, 3:, 3:] = terms.world_from_base @ skew(velocity[:, 3:6])
    return turn @ terms.mass_matrix[:, :6] + body.to_com @ mass_rate


def decoupled_dynamics(
    body: CentroidalTerms, terms: DynamicsTerms, velocity: np.ndarray, coriolis: np.ndarray
) -> DecoupledDynamics:
    """Return the equations of motion in the coordinates xi, [G15] eqs. (12)-(25).

    Args:
        body: `centroidal_terms(terms, velocity)`.
        terms: of the robots.
        velocity: (N, nv).
        coriolis: (N, nv, nv) C with C v + g = bias and Mdot - 2 C skew, see
            `fbid_gym.dynamics.coriolis`.
    """
    forward, inverse = transform(body)
    rate = np.zeros_like(forward)
    rate[:, :6] = momentum_matrix_rate(body, terms, velocity, coriolis)
    inertia = np.zeros_like(forward)
    inertia[:, :6, :6] = momentum_inertia(body)
    inertia[:, 6:, 6:] = joint_inertia(body, terms.mass_matrix)
    gamma = (inverse.mT @ coriolis - inertia @ rate) @ inverse
    return DecoupledDynamics(forward, inverse, rate, inertia, gamma)
