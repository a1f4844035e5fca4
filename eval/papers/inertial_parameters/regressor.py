"""The equations of motion as a linear function of the robot's inertial parameters.

    M(q) a + h(q, v) = Y(q, v, a) pi + diag(armature) a

with pi the ten parameters of each body (see `inertia`), all in MuJoCo's
coordinates, base first. Y depends on the robot's kinematics and on gravity alone. It is Pinocchio's
joint-torque regressor, of the model read from the compiled MuJoCo model, with v and a brought to
Pinocchio's coordinates and the generalized force brought back (`fbid_gym.dynamics.frames`).
"""

import numpy as np
import pinocchio as pin

from eval.papers.inertial_parameters.inertia import (
    body_parameters,
    parameters_of_pseudo_inertia,
    pseudo_inertia,
)
from fbid_gym.dynamics import frames
from fbid_gym.dynamics.pinocchio_model import pinocchio_model
from fbid_gym.robots import Robot


class InertialRegressor:
    """The regressor of a robot's equations of motion.

    Bodies without mass carry no parameters: they have none to find.

    Attributes:
        robot: the robot; of its inertial parameters only the armature matters.
        bodies: (B,) MuJoCo ids of the bodies with parameters.
        names: their names.
        armature: (nv,) kg, kg·m², the part of M's diagonal that belongs to no body.
    """

    def __init__(self, robot: Robot) -> None:
        """Read the robot's kinematics."""
        model = robot.model
        self._model = pinocchio_model(model)
        self._data = self._model.createData()
        self.robot = robot
        member = (model.body_rootid == robot.base_body) & (model.body_mass > 0.0)
        self.bodies = np.flatnonzero(member)
        self.names = tuple(model.body(body).name or f"body {body}" for body in self.bodies)
        self.armature = self._model.armature.copy()
        self.armature[:6] = model.dof_armature[:6]
        carriers = [self._model.frames[int(body)] for body in self.bodies]
        # Pinocchio's parameters belong to joints (joint 0 is the world and has none).
        columns = np.array([10 * (frame.parentJoint - 1) for frame in carriers])
        self._columns = columns[:, None] + np.arange(10)
        self._to_joint = np.array([_move_parameters(frame.placement) for frame in carriers])

    @property
    def num_parameters(self) -> int:
        """Number p = 10 B of parameters."""
        return 10 * len(self.bodies)

    def parameters(self) -> np.ndarray:
        """Return the parameters of the robot's model: (B, 10)."""
        return body_parameters(self.robot.model, self.bodies)

    def rows(self, qpos: np.ndarray, qvel: np.ndarray, qacc: np.ndarray) -> np.ndarray:
        """Return the regressor at N states, in a loop over them.

        Args:
            qpos: (N, nq) m, quaternion wxyz, rad.
            qvel: (N, nv) m/s, rad/s.
            qacc: (N, nv) m/s^2, rad/s^2, rate of qvel.

        Returns:
            Y: (N, nv, 10 B), the bodies in order, ten columns each.
        """
        rotation = frames.quaternion_to_matrix(qpos[:, 3:7])
        configuration = frames.configuration_to_pinocchio(qpos, self.robot.model.qpos0)
        velocity = frames.velocity_to_pinocchio(qvel, rotation)
        acceleration = frames.velocity_to_pinocchio(qacc, rotation)
        acceleration += frames.velocity_product(qvel, rotation)
        motions = zip(configuration, velocity, acceleration, strict=True)
        of_joints = [
            pin.computeJointTorqueRegressor(self._model, self._data, *motion)[:, self._columns]
            for motion in motions
        ]
        rows = (np.array(of_joints)[..., None, :] @ self._to_joint)[..., 0, :]
        columns = rows.reshape(*qvel.shape, self.num_parameters)
        # A generalized force transforms as the rows of a Jacobian do: Y = X^T Y_pin.
        return frames.jacobian_from_pinocchio(columns.mT, rotation).mT


def _move_parameters(placement: pin.SE3) -> np.ndarray:
    """Matrix (10, 10) from a body's parameters in its frame to those in its joint's frame."""
    transform = placement.homogeneous
    moved = transform @ pseudo_inertia(np.eye(10)) @ transform.T
    return parameters_of_pseudo_inertia(moved).T
