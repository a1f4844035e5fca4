"""Inertially decoupled dynamics of a floating base: momentum and joints as velocities, [G15].

With the centroidal momentum h = A v and the joint velocities as coordinates,
xi = [h; qdot] = A_Q v, the mass matrix falls apart into 1/m, Lambda_l and Lambda_q ([G15] eqs.
(12)-(28)). In the symbols of `fbid_gym.dynamics.centroidal`, with A_q the joint columns of A,

    A_Q^-1 = [[P^T Lambda_h, -P^T Lambda_h A_q], [0, E]].

xi, Lambda and Gamma do not depend on the axes in which v has the base's angular velocity. The
joints' armature is part of Lambda_q. The laws of `fbid_gym.control` need none of this: it stands
here so that the tests can check every proposition of the paper. N robots, nv = 6 + n.
"""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from fbid_gym.dynamics import frames
from fbid_gym.dynamics.frames import skew
from fbid_gym.dynamics.pinocchio_dynamics import PinocchioDynamics
from fbid_gym.quantities import CentroidalTerms, DynamicsTerms
from fbid_gym.robots import Robot

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
        coriolis: (N, nv, nv) `coriolis_matrix`.
    """
    forward, inverse = transform(body)
    rate = np.zeros_like(forward)
    rate[:, :6] = momentum_matrix_rate(body, terms, velocity, coriolis)
    inertia = np.zeros_like(forward)
    inertia[:, :6, :6] = momentum_inertia(body)
    inertia[:, 6:, 6:] = joint_inertia(body, terms.mass_matrix)
    gamma = (inverse.mT @ coriolis - inertia @ rate) @ inverse
    return DecoupledDynamics(forward, inverse, rate, inertia, gamma)


def coriolis_matrix(robot: Robot, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
    """Return C with C v + g the bias and Mdot - 2 C skew at N states.

    Pinocchio's matrix has both properties in its own coordinates v_pin = X v. In MuJoCo's,

        C = X^T C_pin X + X^T M_pin Xdot,    Xdot = blkdiag(-skew(omega) R^T, 0, 0),

    has them: the second summand is what keeps C v right and Mdot - 2 C skew at once.

    Args:
        robot: whose.
        qpos: (N, nq) m, quaternion wxyz, rad.
        qvel: (N, nv) m/s, rad/s.

    Returns:
        (N, nv, nv).
    """
    dynamics = PinocchioDynamics(robot)
    rotation = frames.quaternion_to_matrix(qpos[:, 3:7])
    configuration = frames.configuration_to_pinocchio(qpos, robot.model.qpos0)
    velocity = frames.velocity_to_pinocchio(qvel, rotation)
    model, data = dynamics.model, dynamics.model.createData()
    coriolis = np.empty((*qvel.shape, qvel.shape[1]))
    base = np.empty((*qvel.shape, 3))  # the columns of M_pin that Xdot meets
    for i in range(len(qvel)):
        coriolis[i] = pin.computeCoriolisMatrix(model, data, configuration[i], velocity[i])
        base[i] = pin.crba(model, data, configuration[i])[:, :3]
    turn = -skew(qvel[:, 3:6]) @ rotation.mT
    result = frames.mass_matrix_from_pinocchio(coriolis, rotation)
    moved = base @ turn
    moved[:, :3] = rotation @ moved[:, :3]
    result[:, :, :3] += moved
    return result
