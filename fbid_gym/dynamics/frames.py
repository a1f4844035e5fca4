"""Rotations, and the map between MuJoCo's and Pinocchio's coordinates of a floating base.

Both libraries put the floating base first, and differ in how they write it:

=============== ============================== ==================================
quantity        MuJoCo (used everywhere here)  Pinocchio's free-flyer
=============== ============================== ==================================
quaternion      w, x, y, z                     x, y, z, w
linear velocity of the base, in world axes     of the base, in the base's axes
angular         in the base's axes             in the base's axes
acceleration    time derivative of the above   time derivative of the above
=============== ============================== ==================================

With R the rotation of the base (world from base) and X = blkdiag(Rᵀ, I₃, Iₙ),

    v_pin = X v        a_pin = X a + Ẋ v        (Ẋ v)_linear = −ω × (Rᵀ ṗ)
    J = J_pin X        M = Xᵀ M_pin X           h = Xᵀ (h_pin + M_pin Ẋ v)

The Ẋ v term vanishes at rest, so a check at zero velocity cannot tell whether it was forgotten.

All functions are pure and accept any leading batch axes. Velocities (..., 6 + n) are MuJoCo's; a
`rotation` (..., 3, 3) beside them is that of the base, world from base. Rotations are written as
one constant linear map of a small product because at small batches the number of array calls, not
of operations, sets the cost.
"""

import numpy as np

_SKEW_MAP = np.zeros((3, 9))
_SKEW_MAP[[0, 0, 1, 1, 2, 2], [7, 5, 2, 6, 3, 1]] = [1, -1, 1, -1, 1, -1]


def _squares(quaternion: np.ndarray) -> np.ndarray:
    """Entries of |q|² R(q), row by row, and |q|², of a quaternion (4,): (10,)."""
    w, vector = quaternion[0], quaternion[1:]
    matrix = (w * w - vector @ vector) * np.eye(3) + 2 * np.outer(vector, vector)
    matrix += np.reshape(2 * w * vector @ _SKEW_MAP, (3, 3))
    return np.append(matrix, quaternion @ quaternion)


# Map (16, 10) from vec(q qᵀ) to these, by polarisation.
_QUATERNION_MAP = np.array(
    [
        (_squares(one + other) - _squares(one - other)) / 4
        for one in np.eye(4)
        for other in np.eye(4)
    ]
)
# Map (9, 16) from the entries of R to those of 4 q qᵀ − I, for a unit quaternion q. As it happens
# it is the transpose of the map above.
_OUTER_QUATERNION_MAP = _QUATERNION_MAP[:, :9].T.copy()
_IDENTITY = np.eye(4).reshape(16)


# --- rotations -------------------------------------------------------------------------------


def quaternion_to_matrix(quaternion: np.ndarray) -> np.ndarray:
    """Return the rotation matrix (..., 3, 3) of a quaternion (..., 4) w, x, y, z.

    With a body's quaternion, x_world = R x_body. It may be of any length, as in MuJoCo, but zero.
    """
    batch = quaternion.shape[:-1]
    products = np.reshape(quaternion[..., :, None] * quaternion[..., None, :], (*batch, 16))
    entries = products @ _QUATERNION_MAP
    return np.reshape(entries[..., :9] / entries[..., 9:], (*batch, 3, 3))


def _scaled_quaternion(rotation: np.ndarray) -> np.ndarray:
    """Quaternion of a rotation matrix (..., 3, 3), of any sign and a length between 2 and 4.

    Forms 4 q qᵀ, which is linear in R, and takes its column of largest diagonal entry (Shepperd's
    choice), so that no angle is special and nothing cancels.
    """
    outer = np.reshape(rotation, (-1, 9)) @ _OUTER_QUATERNION_MAP
    outer = outer + _IDENTITY
    largest = np.argmax(outer[:, ::5], axis=-1)
    column = np.reshape(outer, (-1, 4, 4))[np.arange(outer.shape[0]), largest]
    return np.reshape(column, (*rotation.shape[:-2], 4))


def matrix_to_quaternion(rotation: np.ndarray) -> np.ndarray:
    """Return the unit quaternion (..., 4) w, x, y, z, w ≥ 0, of a rotation matrix (..., 3, 3)."""
    quaternion = _scaled_quaternion(rotation)
    quaternion = quaternion / np.sqrt(np.vecdot(quaternion, quaternion))[..., None]
    return np.where(quaternion[..., :1] < 0, -quaternion, quaternion)


def rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """Return axis times angle (..., 3) rad, at most π, of a rotation matrix: its logarithm.

    The orientation error that turns R into R_desired is `rotation_vector(R_desired Rᵀ)` in world
    axes and `rotation_vector(Rᵀ R_desired)` in body axes. Accurate at all angles; at π exactly
    the sign of the axis is arbitrary.
    """
    quaternion = _scaled_quaternion(rotation)
    w, vector = quaternion[..., 0], quaternion[..., 1:]
    sine = np.sqrt(np.vecdot(vector, vector))
    half_angle = np.copysign(np.arctan2(sine, np.abs(w)), w)
    # The summand only meets sine = 0, where the vector is zero as well.
    return vector * (2 * half_angle / (sine + 1e-30))[..., None]


def skew(vector: np.ndarray) -> np.ndarray:
    """Return the matrix (..., 3, 3) of the cross product: `skew(a) @ b` = a × b."""
    return np.reshape(vector @ _SKEW_MAP, (*vector.shape[:-1], 3, 3))


# --- from MuJoCo to Pinocchio ------------------------------------------------------------------


def configuration_to_pinocchio(qpos: np.ndarray, qpos0: np.ndarray) -> np.ndarray:
    """Return Pinocchio's configuration of a MuJoCo one.

    Args:
        qpos: (..., 7 + n) base position (m, world), base quaternion w, x, y, z of any length, joint
            positions.
        qpos0: (7 + n,) the model's: MuJoCo's joints are at rest there, Pinocchio's at zero.

    Returns:
        (..., 7 + n) base position, unit quaternion x, y, z, w, joint displacements.
    """
    quaternion = qpos[..., 3:7]
    quaternion = quaternion / np.sqrt(np.vecdot(quaternion, quaternion))[..., None]
    parts = (qpos[..., :3], quaternion[..., 1:], quaternion[..., :1], qpos[..., 7:] - qpos0[7:])
    return np.concatenate(parts, axis=-1)


def velocity_to_pinocchio(velocity: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return the velocity (..., 6 + n) in Pinocchio's coordinates, v_pin = X v."""
    linear = np.matvec(rotation.mT, velocity[..., :3])
    return np.concatenate((linear, velocity[..., 3:]), axis=-1)


def velocity_product(velocity: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return the acceleration Ẋ v (..., 6 + n), which Pinocchio's is when MuJoCo's is zero.

    That is (−ω × Rᵀ ṗ, 0, 0), with ω in the base frame.
    """
    linear = np.matvec(rotation.mT, velocity[..., :3])
    cross = np.matvec(skew(linear), velocity[..., 3:6])  # a × b = −b × a
    return np.concatenate((cross, np.zeros_like(velocity[..., 3:])), axis=-1)


# --- from Pinocchio to MuJoCo ------------------------------------------------------------------


def jacobian_from_pinocchio(jacobian: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return the Jacobian (..., m, 6 + n) of MuJoCo's velocity from Pinocchio's: J = J_pin X."""
    return np.concatenate((jacobian[..., :3] @ rotation.mT, jacobian[..., 3:]), axis=-1)


def mass_matrix_from_pinocchio(mass_matrix: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return the mass matrix (..., 6 + n, 6 + n) in MuJoCo's coordinates: M = Xᵀ M_pin X.

    Without armature on the free joint, which MuJoCo holds in its own coordinates: it comes after.
    """
    right = jacobian_from_pinocchio(mass_matrix, rotation)
    return jacobian_from_pinocchio(right.mT, rotation).mT


def bias_from_pinocchio(
    bias: np.ndarray, mass_matrix: np.ndarray, velocity: np.ndarray, rotation: np.ndarray
) -> np.ndarray:
    """Return the bias force (..., 6 + n) in MuJoCo's coordinates: h = Xᵀ (h_pin + M_pin Ẋ v).

    Of Pinocchio's nonlinear effects, and its mass matrix without armature on the free joint.
    """
    moved = bias + np.matvec(mass_matrix, velocity_product(velocity, rotation))
    return velocity_to_pinocchio(moved, rotation.mT)  # X is orthogonal
