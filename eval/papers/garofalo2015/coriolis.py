"""The Coriolis matrix C of a robot, C v + g the bias and Mdot - 2 C skew, by Pinocchio."""

import numpy as np
import pinocchio as pin

from fbid_gym.dynamics import frames
from fbid_gym.dynamics.mujoco_dynamics import check_states
from fbid_gym.dynamics.pinocchio_dynamics import PinocchioDynamics


def coriolis_matrix(dynamics: PinocchioDynamics, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
    """Return C with C v + g the bias and Mdot - 2 C skew, of the nominal model at N states.

    Pinocchio's matrix has both properties in its own coordinates v_pin = X v. In MuJoCo's,

        C = X^T C_pin X + X^T M_pin Xdot,    Xdot = blkdiag(-skew(omega) R^T, 0, 0),

    has them: the second summand is what keeps C v right and Mdot - 2 C skew at once. It loops over
    the batch in Python.

    Args:
        dynamics: the nominal model.
        qpos: (N, nq) m, quaternion wxyz, rad.
        qvel: (N, nv) m/s, rad/s.

    Returns:
        (N, nv, nv).

    Raises:
        ShapeError: qpos or qvel is not a batch of this robot's states.
        NonFiniteError: a state holds NaN or infinity.
    """
    qpos, qvel = check_states(dynamics.robot, qpos, qvel)
    rotation = frames.quaternion_to_matrix(qpos[:, 3:7])
    configuration = frames.configuration_to_pinocchio(qpos, dynamics.robot.model.qpos0)
    velocity = frames.velocity_to_pinocchio(qvel, rotation)
    model, data = dynamics.model, dynamics.model.createData()
    coriolis = np.empty((*qvel.shape, qvel.shape[1]))
    base = np.empty((*qvel.shape, 3))  # the columns of M_pin that Xdot meets
    for i in range(len(qvel)):
        coriolis[i] = pin.computeCoriolisMatrix(model, data, configuration[i], velocity[i])
        base[i] = pin.crba(model, data, configuration[i])[:, :3]
    turn = -frames.skew(qvel[:, 3:6]) @ rotation.mT
    result = frames.mass_matrix_from_pinocchio(coriolis, rotation)
    moved = base @ turn
    moved[:, :3] = rotation @ moved[:, :3]
    result[:, :, :3] += moved
    return result
