"""Dynamics terms of a nominal model, which may differ from the simulated one, by Pinocchio."""

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from fbid_gym.checks import is_number, real_numbers
from fbid_gym.dynamics import frames
from fbid_gym.dynamics.mujoco_dynamics import check_states, zero_terms
from fbid_gym.dynamics.pinocchio_model import pinocchio_model
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.errors import InvalidValueError, ShapeError, UnknownOptionError
from fbid_gym.quantities import DynamicsTerms
from fbid_gym.robots import Robot

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class PinocchioDynamics:
    """Dynamics terms of a robot at any states, by a nominal model that may be off on purpose.

    A controller never knows the robot it runs on exactly. With `mass_scale` and `com_offset` the
    model differs from the robot's as an identified one would; without them it gives the same terms
    as `MuJoCoDynamics`, by other algorithms.

    It loops over the batch in Python and holds the GIL: meant for one robot or a few. An instance
    has one working memory, so threads need one each.

    Attributes:
        robot: the robot it was built from.
        model: the nominal Pinocchio model, without the free joint's armature (see
            `pinocchio_model`). The frames of its first `nbody` numbers are MuJoCo's bodies.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        mass_scale: float | Mapping[str, float] = 1.0,
        com_offset: Mapping[str, Sequence[float]] | None = None,
    ) -> None:
        """Build the nominal model.

        Args:
            robot: the robot; it is not changed.
            mass_scale: positive factor on mass and rotational inertia, of all bodies or by body
                name. Bodies not named keep theirs.
            com_offset: (3,) m by body name, added to the body's centre of mass, in the body's
                frame. The rotational inertia about the centre of mass is kept.

        Raises:
            RobotError: Pinocchio cannot represent the robot; see `pinocchio_model`.
            UnknownOptionError: a body name is not the robot's.
            InvalidValueError: a scale is not a positive number, or an offset not finite numbers.
            ShapeError: an offset does not have three entries.
        """
        nominal = _nominal(robot.model, mass_scale, com_offset or {})
        self.robot = robot
        self.model = pinocchio_model(nominal)
        self._base_armature = nominal.dof_armature[:6].copy()
        self._feet = []
        # Takes a foot's twist from the centre of its points to the reference below it.
        self._drop = np.tile(np.eye(6), (len(robot.feet), 1, 1))
        for index, foot in enumerate(robot.feet):
            body = self.model.frames[foot.body]
            centre = body.placement * pin.SE3(np.eye(3), foot.points.mean(axis=0))
            frame = pin.Frame(
                f"foot {index}", body.parentJoint, foot.body, centre, pin.FrameType.OP_FRAME
            )
            self._feet.append(self.model.addFrame(frame, False))
            self._drop[index, :3, 3:] = -frames.skew(np.array([0.0, 0.0, -foot.radius]))
        self._data = self.model.createData()

    def terms(self, qpos: np.ndarray, qvel: np.ndarray) -> DynamicsTerms:
        """Return the nominal model's terms at N states.

        Arguments, result and errors are those of `MuJoCoDynamics.terms`; quaternions may have any
        length.

        Raises:
            InvalidValueError: a quaternion is zero.
        """
        qpos, qvel = check_states(self.robot, qpos, qvel)
        norm = np.linalg.norm(qpos[:, 3:7], axis=1)
        if (norm == 0.0).any():
            row = int(np.argmin(norm))
            raise InvalidValueError(f"qpos[{row}, 3:7]", qpos[row, 3:7], "a nonzero quaternion")
        rotation = frames.quaternion_to_matrix(qpos[:, 3:7])
        configuration = frames.configuration_to_pinocchio(qpos, self.robot.model.qpos0)
        velocity = frames.velocity_to_pinocchio(qvel, rotation)
        acceleration = frames.velocity_product(qvel, rotation)

        model, data, found = self.model, self._data, zero_terms(self.robot, len(qpos))
        for i, (q, v) in enumerate(zip(configuration, velocity, strict=True)):
            found.mass_matrix[i] = pin.crba(model, data, q)
            found.bias[i] = pin.nonLinearEffects(model, data, q, v)
            # The free-flyer is joint 1 and its subtree the robot.
            pin.centerOfMass(model, data, q, v, True)
            found.com[i] = data.oMi[1].act(data.com[1])
            found.com_velocity[i] = data.oMi[1].rotation @ data.vcom[1]
            pin.computeJointJacobians(model, data, q)
            # At MuJoCo's acceleration zero, Pinocchio's is not.
            pin.forwardKinematics(model, data, q, v, acceleration[i])
            for k, frame in enumerate(self._feet):
                placement = pin.updateFramePlacement(model, data, frame)
                found.foot_position[i, k] = placement.translation
                found.world_from_foot[i, k] = placement.rotation
                found.foot_velocity[i, k] = pin.getFrameVelocity(model, data, frame, _AXES)
                found.foot_jacobian[i, k] = pin.getFrameJacobian(model, data, frame, _AXES)
                found.foot_bias[i, k] = pin.getFrameClassicalAcceleration(model, data, frame, _AXES)

        found.foot_position[..., 2] -= [foot.radius for foot in self.robot.feet]
        matrix = frames.mass_matrix_from_pinocchio(found.mass_matrix, rotation)
        matrix[:, np.arange(6), np.arange(6)] += self._base_armature
        jacobian = frames.jacobian_from_pinocchio(found.foot_jacobian, rotation[:, None])
        return found._replace(
            mass_matrix=np.ascontiguousarray(matrix),
            bias=frames.bias_from_pinocchio(found.bias, found.mass_matrix, qvel, rotation),
            base_position=qpos[:, :3].copy(),
            world_from_base=rotation,
            world_from_trunk=rotation @ base_from_trunk(self.robot),
            foot_velocity=np.matvec(self._drop, found.foot_velocity),
            foot_jacobian=self._drop @ jacobian,
            foot_bias=np.matvec(self._drop, found.foot_bias),
        )


def _nominal(
    model: mujoco.MjModel,
    mass_scale: float | Mapping[str, float],
    com_offset: Mapping[str, Sequence[float]],
) -> mujoco.MjModel:
    """Return a copy of the model with other inertial parameters, for `pinocchio_model` to read."""
    result = copy.copy(model)
    names = [model.body(body).name for body in range(1, model.nbody)]
    if not isinstance(mass_scale, Mapping):
        scale = _positive("mass_scale", mass_scale)
        result.body_mass *= scale
        result.body_inertia *= scale
    else:
        for name, value in mass_scale.items():
            body = _body("mass_scale", name, names)
            scale = _positive(f"mass_scale[{name!r}]", value)
            result.body_mass[body] *= scale
            result.body_inertia[body] *= scale
    for name, offset in com_offset.items():
        body = _body("com_offset", name, names)
        result.body_ipos[body] += _vector(f"com_offset[{name!r}]", offset)
    return result


def _body(argument: str, name: str, names: Sequence[str]) -> int:
    """The number of a named body."""
    if not name or name not in names:
        raise UnknownOptionError(f"body in {argument}", name, filter(None, names))
    return 1 + names.index(name)


def _positive(argument: str, value: Any) -> float:
    """A positive finite number, or the error that names it."""
    if is_number(value) and 0.0 < value < np.inf:
        return float(value)
    raise InvalidValueError(argument, value, "a positive number, or a mapping from body names")


def _vector(argument: str, value: Sequence[float]) -> np.ndarray:
    """Three finite numbers, or the error that names them."""
    vector = real_numbers(argument, value, "three numbers (m, body frame)")
    if vector.shape != (3,):
        raise ShapeError(argument, vector.shape, "(3,): an offset in m, in the body's frame")
    if not np.isfinite(vector).all():
        raise InvalidValueError(argument, value, "three finite numbers (m, body frame)")
    return vector
