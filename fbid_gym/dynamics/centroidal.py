"""The centroidal momentum of a floating base, and the matrices around it, [G15].

The momentum is h = A v: linear, then angular about the centre of mass, world axes. Everything
needed for A stands in the first six rows of M. With R the base's rotation, c the centre of mass
seen from the base and

    P = [[E, 0], [-skew(c), R]],

which takes a generalized force on the base in MuJoCo's coordinates (force in world axes, moment
about the base in base axes) to a wrench at the centre of mass in world axes,

    A = P M[:6]        P M[:6, :6] P^T = blkdiag(m E, I_c)        Lambda_h = blkdiag(E / m, I_c^-1)

with I_c the inertia of the robot about its centre of mass, joints locked. One 3x3 inverse is all it
takes. [G15] writes v with the base's angular velocity in any frame; v is MuJoCo's here (see
`DynamicsTerms`), and h and Lambda_h do not depend on that choice.

Armature on the free joint has no place in the theory: it makes M unlike that of any rigid bodies,
and none of the propositions hold.

N robots, nv = 6 + n. What runs at every control tick is compiled.
"""

import numpy as np

from fbid_gym.checks import check_shape, contiguous
from fbid_gym.compiled import compiled, kernel
from fbid_gym.errors import ShapeError
from fbid_gym.quantities import CentroidalTerms, DynamicsTerms
from fbid_gym.small_matrices import copy, multiply, multiply_by_transpose, times


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
