"""Inertial parameters of rigid bodies: ten numbers, the pseudo-inertia matrix, and the model.

The ten parameters of a body, in its own frame, are

    (m, m c_x, m c_y, m c_z, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz)

with m its mass, c its centre of mass, and I its rotational inertia about the frame's *origin*. The
equations of motion are linear in them. They belong to a body that can exist, a distribution of
positive mass in space, exactly if the *pseudo-inertia*

    P = [[E, m c], [m c^T, m]],   E = tr(I) / 2 · 1 - I = integral of x x^T dm,

is positive definite: positive mass, positive definite inertia about the centre of mass, and
principal moments that satisfy the triangle inequality (P. M. Wensing, S. Kim, J.-J. E. Slotine,
"Linear matrix inequalities for physically consistent inertial parameter identification", IEEE
Robotics and Automation Letters 3(1), 2018). P is linear in the ten parameters.
"""

import dataclasses

import mujoco
import numpy as np

from fbid_gym.dynamics.frames import matrix_to_quaternion, quaternion_to_matrix
from fbid_gym.errors import InvalidValueError
from fbid_gym.robots import Robot

_INERTIA = ("xx", "xy", "yy", "xz", "yz", "zz")
PARAMETERS = ("mass", *(f"mass {axis}" for axis in "xyz"), *(f"inertia {at}" for at in _INERTIA))
"""Names of a body's parameters, in order: kg, three times kg m, six times kg·m²."""

# Row and column of the inertia tensor for each of the last six parameters.
_ROW, _COLUMN = np.array([0, 0, 1, 0, 1, 2]), np.array([0, 1, 1, 2, 2, 2])


def pseudo_inertia(parameters: np.ndarray) -> np.ndarray:
    """Return the pseudo-inertias (..., 4, 4) of bodies, linear in their parameters (..., 10)."""
    tensor = np.empty((*parameters.shape[:-1], 3, 3))
    tensor[..., _ROW, _COLUMN] = tensor[..., _COLUMN, _ROW] = parameters[..., 4:]
    result = np.empty((*parameters.shape[:-1], 4, 4))
    trace = np.trace(tensor, axis1=-2, axis2=-1)[..., None, None]
    result[..., :3, :3] = trace / 2 * np.eye(3) - tensor
    result[..., :3, 3] = result[..., 3, :3] = parameters[..., 1:4]
    result[..., 3, 3] = parameters[..., 0]
    return result


def parameters_of_pseudo_inertia(matrix: np.ndarray) -> np.ndarray:
    """Return the parameters (..., 10) of bodies with pseudo-inertias (..., 4, 4)."""
    second = matrix[..., :3, :3]
    trace = np.trace(second, axis1=-2, axis2=-1)[..., None, None]
    tensor = trace * np.eye(3) - second
    parts = (matrix[..., 3, 3:], matrix[..., 3, :3], tensor[..., _ROW, _COLUMN])
    return np.concatenate(parts, axis=-1)


def consistency(parameters: np.ndarray) -> np.ndarray:
    """Return how far bodies (..., 10) are from the border of what can exist.

    Returns:
        (...,) smallest eigenvalue of the pseudo-inertia, its rows and columns scaled so that the
        diagonal is 1 in size, or 0; positive exactly if the body can exist, and at most 1.
    """
    matrix = pseudo_inertia(parameters)
    diagonal = np.abs(np.diagonal(matrix, axis1=-2, axis2=-1))
    rounding = 1e-12 * diagonal[..., :3].max(axis=-1, keepdims=True)
    scale = 1.0 / np.sqrt(np.where(diagonal > rounding, diagonal, 1.0))
    return np.linalg.eigvalsh(scale[..., :, None] * matrix * scale[..., None, :])[..., 0]


def body_parameters(model: mujoco.MjModel, bodies: np.ndarray) -> np.ndarray:
    """Return the parameters (B, 10) of a model's bodies, given their ids, in the bodies' frames."""
    mass, com = model.body_mass[bodies, None], model.body_ipos[bodies]
    axes = quaternion_to_matrix(model.body_iquat[bodies])
    moments = model.body_inertia[bodies]
    # The second moments about the centre of mass are diagonal in the principal axes.
    spread = moments.sum(axis=1, keepdims=True) / 2 - moments
    matrix = np.empty((len(bodies), 4, 4))
    matrix[:, :3, :3] = (axes * spread[:, None]) @ axes.mT
    matrix[:, :3, :3] += mass[:, None] * com[:, :, None] * com[:, None]
    matrix[:, :3, 3] = matrix[:, 3, :3] = mass * com
    matrix[:, 3, 3] = mass[:, 0]
    return parameters_of_pseudo_inertia(matrix)


def with_parameters(robot: Robot, bodies: np.ndarray, parameters: np.ndarray) -> Robot:
    """Return the robot with other inertial parameters; geometry, joints and contacts stay.

    Args:
        robot: the robot; it is not changed.
        bodies: B body ids.
        parameters: (B, 10), each of a body that can exist.

    Raises:
        InvalidValueError: parameters that no body can have.
    """
    margin = consistency(parameters)
    if not (margin > 0.0).all():
        worst = int(np.argmin(margin))
        raise InvalidValueError(
            f"parameters of body {robot.model.body(bodies[worst]).name!r}",
            [float(f"{value:.4g}") for value in parameters[worst]],
            "those of a body with positive mass everywhere: a positive definite pseudo-inertia",
        )
    matrix = pseudo_inertia(parameters)
    mass = matrix[:, 3, 3]
    com = matrix[:, :3, 3] / mass[:, None]
    about_com = matrix[:, :3, :3] - mass[:, None, None] * com[:, :, None] * com[:, None]
    spread, axes = np.linalg.eigh(about_com)
    axes[np.linalg.det(axes) < 0.0, :, 0] *= -1.0
    moments, turned = spread.sum(axis=1, keepdims=True) - spread, matrix_to_quaternion(axes)
    spec = robot.spec.copy()
    spec.compile()  # gives bodies their ids
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    spec.compiler.settotalmass = -1.0
    for body in spec.bodies:
        for row in np.flatnonzero(bodies == body.id):
            body.explicitinertial, body.fullinertia = True, np.full(6, np.nan)
            body.mass, body.ipos = mass[row], com[row]
            body.iquat, body.inertia = turned[row], moments[row]
    model = spec.compile()
    whole = float(model.body_subtreemass[robot.base_body])
    return dataclasses.replace(robot, model=model, spec=spec, mass=whole)
