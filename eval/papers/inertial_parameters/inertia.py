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

import copy
import dataclasses
from collections.abc import Sequence

import mujoco
import numpy as np

from fbid_gym.checks import check_finite
from fbid_gym.dynamics.frames import matrix_to_quaternion, quaternion_to_matrix
from fbid_gym.errors import InvalidValueError, ShapeError
from fbid_gym.robots import Robot

PARAMETERS = (
    "mass",
    "mass x",
    "mass y",
    "mass z",
    "inertia xx",
    "inertia xy",
    "inertia yy",
    "inertia xz",
    "inertia yz",
    "inertia zz",
)
"""Names of a body's parameters, in order: kg, three times kg m, six times kg·m²."""

# Row and column of the inertia tensor for each of the last six parameters.
_ROW, _COLUMN = np.array([0, 0, 1, 0, 1, 2]), np.array([0, 1, 1, 2, 2, 2])
# Frames that a geom or site may share with its body's inertia, by which MuJoCo saves arithmetic.
_WITH_INERTIA = (
    int(mujoco.mjtSameFrame.mjSAMEFRAME_INERTIA),
    int(mujoco.mjtSameFrame.mjSAMEFRAME_INERTIAROT),
)


def pseudo_inertia(parameters: np.ndarray) -> np.ndarray:
    """Pseudo-inertia matrices of bodies; linear in the parameters.

    Args:
        parameters: (..., 10).

    Returns:
        (..., 4, 4) symmetric: kg·m², kg·m in the last row and column, kg in the corner.
    """
    tensor = np.empty((*parameters.shape[:-1], 3, 3))
    tensor[..., _ROW, _COLUMN] = tensor[..., _COLUMN, _ROW] = parameters[..., 4:]
    result = np.empty((*parameters.shape[:-1], 4, 4))
    trace = np.trace(tensor, axis1=-2, axis2=-1)[..., None, None]
    result[..., :3, :3] = trace / 2 * np.eye(3) - tensor
    result[..., :3, 3] = result[..., 3, :3] = parameters[..., 1:4]
    result[..., 3, 3] = parameters[..., 0]
    return result


def parameters_of_pseudo_inertia(matrix: np.ndarray) -> np.ndarray:
    """Parameters of bodies: the inverse of `pseudo_inertia`.

    Args:
        matrix: (..., 4, 4) symmetric.

    Returns:
        (..., 10).
    """
    second = matrix[..., :3, :3]
    trace = np.trace(second, axis1=-2, axis2=-1)[..., None, None]
    tensor = trace * np.eye(3) - second
    parts = (matrix[..., 3, 3:], matrix[..., 3, :3], tensor[..., _ROW, _COLUMN])
    return np.concatenate(parts, axis=-1)


def consistency(parameters: np.ndarray) -> np.ndarray:
    """How far bodies are from the border of what can exist.

    Args:
        parameters: (..., 10).

    Returns:
        (...,) smallest eigenvalue of the pseudo-inertia, its rows and columns scaled so that the
        diagonal is 1 in size; positive exactly if the body can exist, and at most 1.
    """
    matrix = pseudo_inertia(parameters)
    diagonal = np.abs(np.diagonal(matrix, axis1=-2, axis2=-1))
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = scale[..., :, None] * matrix * scale[..., None, :]
    return np.linalg.eigvalsh(scaled)[..., 0]


def body_parameters(model: mujoco.MjModel, bodies: Sequence[int] | np.ndarray) -> np.ndarray:
    """Parameters of a model's bodies, in the bodies' frames.

    Args:
        model: compiled.
        bodies: B body ids.

    Returns:
        (B, 10).
    """
    ids = np.asarray(bodies, dtype=int)
    mass, com = model.body_mass[ids, None], model.body_ipos[ids]
    axes = quaternion_to_matrix(model.body_iquat[ids])
    moments = model.body_inertia[ids]
    # The second moments about the centre of mass are diagonal in the principal axes.
    spread = moments.sum(axis=1, keepdims=True) / 2 - moments
    matrix = np.empty((len(ids), 4, 4))
    matrix[:, :3, :3] = (axes * spread[:, None]) @ axes.mT
    matrix[:, :3, :3] += mass[:, None] * com[:, :, None] * com[:, None]
    matrix[:, :3, 3] = matrix[:, 3, :3] = mass * com
    matrix[:, 3, 3] = mass[:, 0]
    return parameters_of_pseudo_inertia(matrix)


def with_parameters(
    robot: Robot,
    bodies: Sequence[int] | np.ndarray,
    parameters: np.ndarray,
    *,
    name: str | None = None,
) -> Robot:
    """Return the robot with other inertial parameters; geometry, joints and contacts stay.

    Args:
        robot: the robot; it is not changed.
        bodies: B body ids.
        parameters: (B, 10), each of a body that can exist.
        name: name of the new robot; the old one by default.

    Raises:
        ShapeError: `parameters` does not have ten entries per body.
        NonFiniteError: a parameter is NaN or infinite.
        InvalidValueError: parameters that no body can have.
    """
    ids, parameters = np.asarray(bodies, dtype=int), np.asarray(parameters, dtype=float)
    if parameters.shape != (len(ids), 10):
        raise ShapeError("parameters", parameters.shape, f"({len(ids)}, 10), ten for each body")
    check_finite("parameters", parameters)
    margin = consistency(parameters)
    if (margin <= 0.0).any():
        worst = int(np.argmin(margin))
        raise InvalidValueError(
            f"parameters of body {robot.model.body(ids[worst]).name!r}",
            [float(f"{value:.4g}") for value in parameters[worst]],
            "those of a body with positive mass everywhere: a positive definite pseudo-inertia",
        )
    model = copy.copy(robot.model)
    matrix = pseudo_inertia(parameters)
    mass = matrix[:, 3, 3]
    com = matrix[:, :3, 3] / mass[:, None]
    about_com = matrix[:, :3, :3] - mass[:, None, None] * com[:, :, None] * com[:, None]
    spread, axes = np.linalg.eigh(about_com)
    axes[np.linalg.det(axes) < 0.0, :, 0] *= -1.0
    model.body_mass[ids], model.body_ipos[ids] = mass, com
    model.body_inertia[ids] = spread.sum(axis=1, keepdims=True) - spread
    model.body_iquat[ids] = matrix_to_quaternion(axes)
    # The inertial frame has moved away from what lay in it.
    for frames, owners in (
        (model.geom_sameframe, model.geom_bodyid),
        (model.site_sameframe, model.site_bodyid),
    ):
        frames[np.isin(frames, _WITH_INERTIA) & np.isin(owners, ids)] = 0
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return dataclasses.replace(
        robot,
        name=name or robot.name,
        model=model,
        spec=_told(robot.spec, model, ids),
        mass=float(model.body_subtreemass[robot.base_body]),
    )


def _told(spec: mujoco.MjSpec, model: mujoco.MjModel, ids: np.ndarray) -> mujoco.MjSpec:
    """Return a spec of which the bodies `ids` are those of a model: worlds are made of it."""
    told = spec.copy()
    told.compile()  # gives bodies their ids
    told.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    told.compiler.settotalmass = -1.0
    for body in told.bodies:
        if body.id in ids:
            body.explicitinertial = True
            body.mass, body.ipos = model.body_mass[body.id], model.body_ipos[body.id]
            body.iquat, body.inertia = model.body_iquat[body.id], model.body_inertia[body.id]
            body.fullinertia = np.full(6, np.nan)
    return told
