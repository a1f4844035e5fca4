"""The propositions of [G15], at random states with velocity, from both providers.

With the centroidal momentum h = A v and the joint velocities as coordinates, xi = A_Q v, the mass
matrix falls apart into E / m, Lambda_l and Lambda_q, eqs. (12)-(28). The laws need no more than
`CentroidalTerms`; all other matrices are here, by their definitions.
"""

import copy
from typing import NamedTuple

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from fbid_gym import robots
from fbid_gym.dynamics import CentroidalTerms, MuJoCoDynamics, centroidal_terms, frames
from fbid_gym.dynamics.contacts import contact_geometry, point_jacobian, point_positions
from fbid_gym.dynamics.pinocchio_dynamics import PinocchioDynamics
from fbid_gym.quantities import DynamicsTerms
from tests.dynamics.models import assert_close, random_states, robot_called

COUNT = 6
RANDOM = (4, 8)  # seeds of random trees with slides, joint offsets and tilted gravity


class Case(NamedTuple):
    """A robot at COUNT random states."""

    robot: robots.Robot
    qpos: np.ndarray
    velocity: np.ndarray
    terms: DynamicsTerms
    gravity_force: np.ndarray
    body: CentroidalTerms
    inverse_mass: np.ndarray
    coriolis: np.ndarray  # C, with C v + g the bias and Mdot - 2 C skew
    transform: np.ndarray  # A_Q of eq. (12)
    back: np.ndarray  # its inverse
    rate: np.ndarray  # its time derivative
    inertia: np.ndarray  # Lambda of eq. (15)
    gamma: np.ndarray  # of eqs. (15) and (18)

    def pseudo_inverse(self, matrix: np.ndarray) -> np.ndarray:
        """T^{+M} of footnote 1."""
        weighted = self.inverse_mass @ matrix.mT
        return weighted @ np.linalg.inv(matrix @ weighted)

    def momentum_rate(self, force: np.ndarray) -> np.ndarray:
        """Rate (COUNT, 6) of h under generalized forces, the bias not among them."""
        pushed = np.matvec(self.body.matrix, np.matvec(self.inverse_mass, force))
        return pushed + np.matvec(self.rate[:, :6], self.velocity)

    def points(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Jacobian of the contact points, random forces on them, their wrench at the centre."""
        geometry = contact_geometry(self.robot)
        force = 10.0 * rng.normal(size=(COUNT, geometry.num_points, 3))
        arm = point_positions(geometry, self.terms) - self.terms.com[:, None]
        wrench = np.concatenate([force.sum(1), np.cross(arm, force).sum(1)], axis=1)
        return point_jacobian(geometry, self.terms)[0], force.reshape(COUNT, -1), wrench


def coriolis_of(robot: robots.Robot, qpos: np.ndarray, qvel: np.ndarray) -> np.ndarray:
    """C from Pinocchio's: with v_pin = X v, C = X^T C_pin X + X^T M_pin Xdot."""
    model = PinocchioDynamics(robot).model
    data, rotation = model.createData(), frames.quaternion_to_matrix(qpos[:, 3:7])
    q = frames.configuration_to_pinocchio(qpos, robot.model.qpos0)
    v = frames.velocity_to_pinocchio(qvel, rotation)
    own = [pin.computeCoriolisMatrix(model, data, *each).copy() for each in zip(q, v, strict=True)]
    base = np.array([pin.crba(model, data, each)[:, :3] for each in q])  # that Xdot meets
    moved = base @ (-frames.skew(qvel[:, 3:6]) @ rotation.mT)
    moved[:, :3] = rotation @ moved[:, :3]
    result = frames.mass_matrix_from_pinocchio(np.array(own), rotation)
    result[:, :, :3] += moved
    return result


def matrix_rate(
    body: CentroidalTerms, terms: DynamicsTerms, velocity: np.ndarray, coriolis: np.ndarray
) -> np.ndarray:
    """Adot (N, 6, nv), of A = P M[:6] with Mdot = C + C^T."""
    turn = np.zeros_like(body.to_com)
    turn[:, 3:, :3] = frames.skew(velocity[:, :3] - terms.com_velocity)
    turn[:, 3:, 3:] = terms.world_from_base @ frames.skew(velocity[:, 3:6])
    mass_rate = coriolis[:, :6] + coriolis[:, :, :6].mT
    return turn @ terms.mass_matrix[:, :6] + body.to_com @ mass_rate


def decoupled(terms: DynamicsTerms, velocity: np.ndarray) -> tuple[np.ndarray, ...]:
    """A_Q, its inverse and Lambda = A_Q^-T M A_Q^-1."""
    transform = np.tile(np.eye(velocity.shape[1]), (len(velocity), 1, 1))
    transform[:, :6] = centroidal_terms(terms, velocity).matrix
    back = np.linalg.inv(transform)
    return transform, back, back.mT @ terms.mass_matrix @ back


@pytest.fixture(scope="module", params=[*robots.ROBOTS, *RANDOM])
def robot(request):
    return robot_called(request.param)


@pytest.fixture(scope="module")
def case(robot):
    """From one provider for every other robot; tests/dynamics holds that both say the same."""
    qpos, velocity = random_states(robot.model, COUNT)
    by_mujoco = robot.name not in (*robots.ROBOTS[::2], f"random{RANDOM[0]}")
    dynamics = (MuJoCoDynamics if by_mujoco else PinocchioDynamics)(robot)
    terms, coriolis = dynamics.terms(qpos, velocity), coriolis_of(robot, qpos, velocity)
    body = centroidal_terms(terms, velocity)
    transform, back, inertia = decoupled(terms, velocity)
    rate = np.zeros_like(transform)
    rate[:, :6] = matrix_rate(body, terms, velocity, coriolis)
    return Case(
        *(robot, qpos, velocity, terms, dynamics.terms(qpos, 0.0 * velocity).bias, body),
        *(np.linalg.inv(terms.mass_matrix), coriolis, transform, back, rate, inertia),
        (back.mT @ coriolis - inertia @ rate) @ back,
    )


def assert_zero(actual, scale):
    assert_close(actual, np.zeros_like(actual), scale)


def assert_rate(actual, case, quantity, tolerance, least=0.0):
    """Against differences of fourth order of quantity(terms), at constant generalized velocity."""

    def at(time):
        qpos = case.qpos.copy()
        for row, velocity in zip(qpos, case.velocity, strict=True):
            mujoco.mj_integratePos(case.robot.model, row, velocity, time)
        return quantity(MuJoCoDynamics(case.robot).terms(qpos, case.velocity))

    step = 1e-4
    rate = (8.0 * (at(step) - at(-step)) - (at(2 * step) - at(-2 * step))) / (12.0 * step)
    size = max(least, np.abs(actual).max())
    np.testing.assert_allclose(actual, rate, rtol=0.0, atol=tolerance * size)


def test_coriolis_matrix_gives_the_bias_and_the_rate_of_the_mass_matrix(case):
    force = np.matvec(case.coriolis, case.velocity) + case.gravity_force
    assert_close(force, case.terms.bias)
    assert_rate(case.coriolis + case.coriolis.mT, case, lambda terms: terms.mass_matrix, 1e-7)


# --- section 2: momentum -----------------------------------------------------------------------


def test_matrix_and_its_rate_are_pinocchios(case):
    model = PinocchioDynamics(case.robot).model
    data, rotation = model.createData(), frames.quaternion_to_matrix(case.qpos[:, 3:7])
    q = frames.configuration_to_pinocchio(case.qpos, case.robot.model.qpos0)
    v = frames.velocity_to_pinocchio(case.velocity, rotation)
    for row in range(COUNT):
        pin.dccrba(model, data, q[row], v[row])
        # A = A_pin X, so Adot = Adot_pin X + A_pin Xdot.
        turn = -frames.skew(case.velocity[row, 3:6]) @ rotation[row].T
        expected = frames.jacobian_from_pinocchio(data.dAg, rotation[row])
        expected[:, :3] += data.Ag[:, :3] @ turn
        assert_close(case.rate[row, :6], expected)
        assert_close(case.body.matrix[row], frames.jacobian_from_pinocchio(data.Ag, rotation[row]))
        assert_close(case.body.momentum[row], data.hg.vector)

    def matrix(terms):
        return centroidal_terms(terms, case.velocity).matrix

    assert_rate(case.rate[:, :6], case, matrix, 1e-7)


def test_eq_6_rate_of_momentum_is_the_external_wrench(case, rng):
    jacobian, force, wrench = case.points(rng)
    total = np.matvec(jacobian.mT, force) - case.terms.bias
    total[:, 6:] += rng.normal(size=(COUNT, case.robot.num_joints))
    wrench[:, :3] += case.robot.mass * case.robot.model.opt.gravity
    assert_close(case.momentum_rate(total), wrench, case.terms.bias)


def test_eqs_7_8_10_and_11_what_conserves_momentum(case, rng):
    """Motor torques alone all of it, a force at the centre of mass the angular one."""
    drift = np.matvec(case.coriolis, case.velocity)
    torque = np.zeros_like(drift)
    torque[:, 6:] = rng.normal(size=(COUNT, case.robot.num_joints))
    assert_zero(case.momentum_rate(torque - drift), drift)
    product = case.body.matrix @ case.inverse_mass
    assert_zero(product[:, :, 6:], product)
    push = 10.0 * rng.normal(size=(COUNT, 3))
    at_com = case.body.matrix[:, :3] / case.robot.mass  # J_CoM, eq. (5)
    force = np.matvec(at_com.mT, push) - drift
    assert_zero(case.momentum_rate(force)[:, 3:], force)


# --- section 3: the decoupled structure ------------------------------------------------------


def test_eq_13_inverse_without_a_full_inverse(case):
    columns = map(case.pseudo_inverse, (case.body.matrix, case.transform[:, 6:]))
    assert_close(case.back, np.concatenate([*columns], axis=2))


def test_eqs_15_and_25_equations_of_motion(case, rng):
    """Any generalized force moves the robot as the decoupled equations say."""
    force = 5.0 * rng.normal(size=(COUNT, case.robot.nv))
    acceleration = np.matvec(case.inverse_mass, force - case.terms.bias)
    rate = np.matvec(case.transform, acceleration) + np.matvec(case.rate, case.velocity)
    left = np.matvec(case.inertia, rate)
    left += np.matvec(case.gamma, np.matvec(case.transform, case.velocity))
    left[:, :3] -= case.robot.model.opt.gravity
    assert_close(left, np.matvec(case.back.mT, force), case.terms.bias)


def test_eqs_16_17_22_24_28_and_29_inertia_is_block_diagonal(case):
    expected = np.zeros_like(case.inertia)
    expected[:, :3, :3] = np.eye(3) / case.robot.mass
    expected[:, 3:6, 3:6] = case.body.inverse_inertia
    expected[:, 6:, 6:] = np.linalg.inv(case.inverse_mass[:, 6:, 6:])
    assert_close(case.inertia, expected)
    joints = case.terms.mass_matrix[:, 6:, 6:]  # less A_q^T Lambda_h A_q
    joints = joints - case.body.wrench_map[:, 6:] @ case.body.matrix[:, :, 6:]
    assert_close(case.inertia[:, 6:, 6:], joints)
    at_com = case.body.matrix[:, :3] / case.robot.mass
    assert_close(at_com @ case.inverse_mass @ at_com.mT, expected[:, :3, :3])


def test_eqs_15_19_and_25_velocities_are_coupled_without_work(case):
    gamma, inner = case.gamma, slice(3)
    assert_zero(gamma[:, 6:, :6] + gamma[:, :6, 6:].mT, gamma)
    assert_zero(gamma[:, 3:6, :3] + gamma[:, :3, 3:6].mT, gamma)
    assert_zero(gamma[:, inner, inner] + gamma[:, inner, inner].mT, gamma)
    assert_rate(gamma + gamma.mT, case, lambda terms: decoupled(terms, case.velocity)[2], 1e-6, 1.0)
    # Joints do not push the momentum.
    xi = np.matvec(case.transform, case.velocity)
    assert_zero(np.matvec(gamma[:, :6], xi), np.abs(gamma[:, :6]).max() * np.abs(xi).max())


def test_eq_26_gravity_acts_on_the_linear_momentum_alone(case):
    expected = np.zeros_like(case.gravity_force)
    expected[:, :3] = -case.robot.model.opt.gravity
    assert_close(np.matvec(case.back.mT, case.gravity_force), expected, case.gravity_force)


def test_eqs_30_and_32_wrench_at_the_com(case, rng):
    wrench = rng.normal(size=(COUNT, 6))
    assert_close(case.body.wrench_map, case.body.matrix.mT @ case.inertia[:, :6, :6])
    drift = np.matvec(case.coriolis, case.velocity)
    force = np.matvec(case.body.wrench_map, wrench) - drift
    assert_close(case.momentum_rate(force), wrench, drift)


def generalized_jacobian(mass_matrix, jacobian):
    """Of a free-floating robot (Umetani and Yoshida 1987)."""
    base = np.linalg.solve(mass_matrix[:, :6, :6], mass_matrix[:, :6, 6:])
    return jacobian[:, :, 6:] - jacobian[:, :, :6] @ base


def test_eq_33_generalized_jacobian_and_what_eq_38_rests_on(case, rng):
    """Jbar_b^T f = Lambda_h (wrench of f at the centre of mass)."""
    jacobian, force, wrench = case.points(rng)
    transformed = jacobian @ case.back
    joints = generalized_jacobian(case.terms.mass_matrix, jacobian)
    assert_close(transformed[:, :, 6:], joints)
    assert_close(joints, jacobian @ case.pseudo_inverse(case.transform[:, 6:]))
    expected = np.matvec(case.inertia[:, :6, :6], wrench)
    assert_close(np.matvec(transformed[:, :, :6].mT, force), expected)


def test_eq_21_and_appendix_pseudo_inverse_of_the_momentum_matrix_by_its_halves(case):
    """A^{+M} = M^-1 A^T blkdiag(Lambda_p, Lambda_l) = [A_p^{+M}, A_l^{+M}]."""
    matrix, expected = case.body.matrix, case.pseudo_inverse(case.body.matrix)
    product = case.inverse_mass @ matrix.mT
    assert_zero(matrix[:, 3:] @ product[:, :, :3], product)
    halves = [case.pseudo_inverse(matrix[:, part]) for part in (slice(3), slice(3, 6))]
    assert_close(np.concatenate(halves, axis=2), expected)
    assert_close(product @ case.inertia[:, :6, :6], expected)


def test_eqs_35_and_37_the_model_of_ott_2011(case, rng):
    """With v_C = [velocity of the centre of mass, world spin of the base, joint rates] = T v.

    The centre of mass is on its own, hip and joints are coupled; and the joints' block is not
    Lambda_q, as the paper labels it, but Lambda_q once the hip is eliminated, too.
    """
    mass, terms = case.robot.mass, case.terms
    change = np.tile(np.eye(case.robot.nv), (COUNT, 1, 1))
    change[:, :3] = case.body.matrix[:, :3] / mass
    change[:, 3:6, 3:6] = terms.world_from_base
    back = np.linalg.inv(change)
    inertia = back.mT @ terms.mass_matrix @ back
    assert_close(inertia[:, :3, :3], np.broadcast_to(mass * np.eye(3), (COUNT, 3, 3)))
    assert_zero(inertia[:, :3, 3:], inertia)
    hip, coupling, joints = inertia[:, 3:6, 3:6], inertia[:, 3:6, 6:], inertia[:, 6:, 6:]
    assert_close(hip, case.body.inertia)
    eliminated = coupling.mT @ np.linalg.solve(hip, coupling)
    assert_close(joints - eliminated, case.inertia[:, 6:, 6:], joints)
    assert np.abs(eliminated).max() > 0.01 * np.abs(joints).max()
    # The angular momentum, of which (36) counts the hip's part alone.
    rates = np.matvec(change, case.velocity)
    angular = np.matvec(hip, rates[:, 3:6]) + np.matvec(coupling, rates[:, 6:])
    assert_close(angular, case.body.momentum[:, 3:])
    expected = np.zeros_like(rates)
    expected[:, :3] = -mass * case.robot.model.opt.gravity
    assert_close(np.matvec(back.mT, case.gravity_force), expected, case.gravity_force)
    jacobian, force, wrench = case.points(rng)
    assert_close(np.matvec((jacobian @ back)[:, :, :6].mT, force), wrench)


def test_eq_34_kinetic_energy_in_three_parts(case):
    linear, angular = case.body.momentum[:, :3], case.body.momentum[:, 3:]
    joints = case.velocity[:, 6:]
    parts = np.array([
        np.vecdot(linear, linear) / case.body.mass,
        np.vecdot(angular, np.matvec(case.body.inverse_inertia, angular)),
        np.vecdot(joints, np.matvec(case.inertia[:, 6:, 6:], joints)),
    ])  # fmt: skip
    assert (parts > 0.0).all()
    whole = np.vecdot(case.velocity, np.matvec(case.terms.mass_matrix, case.velocity))
    assert_close(parts.sum(axis=0), whole)


@pytest.mark.parametrize("name", robots.ROBOTS)
def test_in_flight_motors_move_joints_and_feet_but_not_the_momentum(name):
    """Simulated without gravity and contacts: h stays zero, Jbar qdot is the feet's velocity."""
    robot = robots.load(name)
    model = copy.copy(robot.model)
    model.opt.gravity[:] = 0.0
    model.opt.timestep, model.opt.integrator = 5e-4, mujoco.mjtIntegrator.mjINT_RK4
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    data.qpos[:] = robot.home_qpos
    rng, dynamics = np.random.default_rng(3), MuJoCoDynamics(robot)
    torque = 0.1 * robot.torque_limit * rng.choice([-1.0, 1.0], robot.num_joints)
    fastest = 0.0
    for half in range(10):
        data.ctrl[robot.actuator] = (1.0 if half < 5 else -1.0) * torque / robot.gear
        mujoco.mj_step(model, data, nstep=20)
        velocity = data.qvel[None]
        terms = dynamics.terms(data.qpos[None], velocity)
        body = centroidal_terms(terms, velocity)
        size = np.abs(body.matrix[0] * data.qvel).sum(axis=1)
        assert (np.abs(body.momentum[0]) < 1e-6 * size).all()
        jacobian = generalized_jacobian(terms.mass_matrix, terms.foot_jacobian[:, 0])
        speed = np.abs(terms.foot_velocity[:, 0]).max()
        found = np.matvec(jacobian, velocity[:, 6:])
        np.testing.assert_allclose(found, terms.foot_velocity[:, 0], atol=1e-6 * speed)
        fastest = max(fastest, speed)
    assert fastest > 0.5
