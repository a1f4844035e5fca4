"""The propositions of [G15], at random states with velocity, from both providers."""

import copy
from typing import NamedTuple

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from eval.papers.garofalo2015.decoupled_dynamics import (
    DecoupledDynamics,
    coriolis_matrix,
    decoupled_dynamics,
    generalized_jacobian,
    joint_inertia,
    kinetic_energy,
    momentum_inertia,
    momentum_matrix_rate,
    momentum_rate_bias,
    transform,
    transformed_jacobian,
)
from fbid_gym import robots
from fbid_gym.dynamics import CentroidalTerms, MuJoCoDynamics, centroidal_terms, frames
from fbid_gym.dynamics.contacts import contact_geometry, point_jacobian, point_positions
from fbid_gym.dynamics.pinocchio_dynamics import PinocchioDynamics
from fbid_gym.quantities import DynamicsTerms

EXACT = 1e-9
COUNT = 6
RANDOM = (4, 8)  # seeds of random trees with slides, joint offsets and tilted gravity
RANDOM_FEET = {"flat": [f"corner{index}" for index in range(4)], "ball": ["ball"]}


class Case(NamedTuple):
    """A robot at COUNT random states, and everything [G15] says about it."""

    robot: robots.Robot
    qpos: np.ndarray
    velocity: np.ndarray
    terms: DynamicsTerms
    coriolis: np.ndarray
    gravity_force: np.ndarray
    body: CentroidalTerms
    full: DecoupledDynamics
    inverse_mass: np.ndarray

    @property
    def xi(self) -> np.ndarray:
        """Momentum and joint velocities."""
        return np.matvec(self.full.transform, self.velocity)

    @property
    def selection(self) -> np.ndarray:
        """Q of eq. (1)."""
        return np.eye(self.robot.nv)[6:]

    def pseudo_inverse(self, matrix: np.ndarray) -> np.ndarray:
        """T^{+M} of footnote 1."""
        weighted = self.inverse_mass @ matrix.mT
        return weighted @ np.linalg.inv(matrix @ weighted)


@pytest.fixture(scope="module", params=[*robots.ROBOTS, *RANDOM])
def robot(request, tmp_path_factory, random_mjcf):
    if isinstance(request.param, str):
        return robots.load(request.param)
    path = tmp_path_factory.mktemp("robots") / "random.xml"
    path.write_text(random_mjcf(request.param))
    return robots.Robot.from_mjcf(path, RANDOM_FEET)


@pytest.fixture(scope="module")
def case(robot, random_states):
    """From one provider for every other robot; tests/dynamics holds that both say the same."""
    qpos, velocity = random_states(robot.model, COUNT)
    mujoco = robot.name not in (*robots.ROBOTS[::2], f"random{RANDOM[0]}")
    dynamics = (MuJoCoDynamics if mujoco else PinocchioDynamics)(robot)
    coriolis = coriolis_matrix(robot, qpos, velocity)
    terms = dynamics.terms(qpos, velocity)
    body = centroidal_terms(terms, velocity)
    return Case(
        robot=robot,
        qpos=qpos,
        velocity=velocity,
        terms=terms,
        coriolis=coriolis,
        gravity_force=dynamics.terms(qpos, 0.0 * velocity).bias,
        body=body,
        full=decoupled_dynamics(body, terms, velocity, coriolis),
        inverse_mass=np.linalg.inv(terms.mass_matrix),
    )


def assert_close(actual, expected, scale=None):
    """Equal to 1e-9 of the largest entry expected, or of `scale`."""
    if scale is None:
        scale = np.abs(expected).max()
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=EXACT * scale)


def assert_zero(actual, scale):
    """Zero to 1e-9 of the largest entry of `scale`."""
    assert_close(actual, np.zeros_like(actual), np.abs(scale).max())


def moved(case, time):
    """Configurations after moving for `time` with constant generalized velocity."""
    result = case.qpos.copy()
    for row, velocity in zip(result, case.velocity, strict=True):
        mujoco.mj_integratePos(case.robot.model, row, velocity, time)
    return result


def time_derivative(case, quantity, step=1e-4):
    """Of quantity(terms) along the motion, by differences of fourth order."""
    dynamics = MuJoCoDynamics(case.robot)

    def at(time):
        return quantity(dynamics.terms(moved(case, time), case.velocity))

    return (8.0 * (at(step) - at(-step)) - (at(2 * step) - at(-2 * step))) / (12.0 * step)


# --- the Coriolis matrix ---------------------------------------------------------------------


def test_coriolis_matrix_gives_the_bias(case):
    force = np.matvec(case.coriolis, case.velocity) + case.gravity_force
    assert_close(force, case.terms.bias)


def test_mass_rate_less_twice_coriolis_is_skew(case):
    rate = time_derivative(case, lambda terms: terms.mass_matrix)
    np.testing.assert_allclose(
        case.coriolis + case.coriolis.mT, rate, rtol=0.0, atol=1e-7 * np.abs(rate).max()
    )


# --- section 2: momentum -----------------------------------------------------------------------


def test_matrix_and_its_rate_are_pinocchios(robot, random_states):
    qpos, velocity = random_states(robot.model, COUNT)
    dynamics = PinocchioDynamics(robot)
    terms = dynamics.terms(qpos, velocity)
    body = centroidal_terms(terms, velocity)
    rate = momentum_matrix_rate(body, terms, velocity, coriolis_matrix(robot, qpos, velocity))
    rotation = frames.quaternion_to_matrix(qpos[:, 3:7])
    data = dynamics.model.createData()
    q = frames.configuration_to_pinocchio(qpos, robot.model.qpos0)
    v = frames.velocity_to_pinocchio(velocity, rotation)
    for row in range(COUNT):
        pin.dccrba(dynamics.model, data, q[row], v[row])
        # A = A_pin X, so Adot = Adot_pin X + A_pin Xdot.
        turn = -frames.skew(velocity[row, 3:6]) @ rotation[row].T
        expected = frames.jacobian_from_pinocchio(data.dAg, rotation[row])
        expected[:, :3] += data.Ag[:, :3] @ turn
        assert_close(rate[row], expected)
        assert_close(body.matrix[row], frames.jacobian_from_pinocchio(data.Ag, rotation[row]))


def test_eq_6_rate_of_momentum_is_the_external_wrench(case, rng):
    torque = rng.normal(size=(COUNT, case.robot.num_joints))
    geometry = contact_geometry(case.robot)
    force = 10.0 * rng.normal(size=(COUNT, geometry.num_points, 3))
    jacobian, _ = point_jacobian(geometry, case.terms)
    generalized = np.matvec(jacobian.mT, force.reshape(COUNT, -1)) - case.terms.bias
    generalized[:, 6:] += torque
    acceleration = np.matvec(case.inverse_mass, generalized)
    rate = np.matvec(case.body.matrix, acceleration)
    rate += np.matvec(case.full.transform_rate[:, :6], case.velocity)
    arm = point_positions(geometry, case.terms) - case.terms.com[:, None]
    weight = case.robot.mass * case.robot.model.opt.gravity
    expected = np.concatenate([force.sum(1) + weight, np.cross(arm, force).sum(1)], axis=1)
    assert_close(rate, expected, np.abs(case.terms.bias).max())


def test_eq_7_motor_torques_alone_conserve_momentum(case, rng):
    force = -np.matvec(case.coriolis, case.velocity)
    force[:, 6:] += rng.normal(size=(COUNT, case.robot.num_joints))
    acceleration = np.matvec(case.inverse_mass, force)
    product = np.matvec(case.body.matrix, acceleration)
    assert_close(product, -np.matvec(case.full.transform_rate[:, :6], case.velocity))


def test_eq_8_force_at_the_com_conserves_angular_momentum(case, rng):
    push = 10.0 * rng.normal(size=(COUNT, 3))
    at_com = case.body.matrix[:, :3] / case.robot.mass  # J_CoM, eq. (5)
    force = np.matvec(at_com.mT, push) - np.matvec(case.coriolis, case.velocity)
    acceleration = np.matvec(case.inverse_mass, force)
    product = np.matvec(case.body.matrix[:, 3:], acceleration)
    rate = np.matvec(case.full.transform_rate[:, 3:6], case.velocity)
    assert_zero(product + rate, force)


def test_rate_bias_needs_no_derivative(case):
    gravity = tuple(case.robot.model.opt.gravity)
    bias = momentum_rate_bias(case.body, case.terms.bias, gravity)
    expected = np.matvec(case.full.transform_rate[:, :6], case.velocity)
    assert_close(bias, expected, np.abs(case.terms.bias).max())


def test_matrix_rate_is_the_derivative(case):
    rate = time_derivative(case, lambda terms: centroidal_terms(terms, case.velocity).matrix)
    np.testing.assert_allclose(
        case.full.transform_rate[:, :6], rate, rtol=0.0, atol=1e-7 * np.abs(rate).max()
    )
    np.testing.assert_array_equal(case.full.transform_rate[:, 6:], 0.0)


# --- section 3: the decoupled structure ------------------------------------------------------


def test_eq_10_torques_do_not_change_momentum(case):
    product = case.body.matrix @ case.inverse_mass
    assert_zero((product @ case.selection.T), product)


def test_eq_11(case):
    force = np.matvec(case.coriolis, case.velocity)
    product = np.matvec(case.body.matrix @ case.inverse_mass, force)
    rate = np.matvec(case.full.transform_rate[:, :6], case.velocity)
    assert_zero(product - rate, force)


def test_eq_13_inverse_without_a_full_inverse(case):
    forward, inverse = transform(case.body)
    columns = (case.pseudo_inverse(case.body.matrix), case.pseudo_inverse(case.selection))
    assert_close(inverse, np.concatenate(columns, axis=2))
    assert_close(forward @ inverse, np.broadcast_to(np.eye(case.robot.nv), inverse.shape))


def test_eqs_15_and_25_equations_of_motion(case, rng):
    # Any generalized force moves the robot as the decoupled equations say.
    force = 5.0 * rng.normal(size=(COUNT, case.robot.nv))
    acceleration = np.matvec(case.inverse_mass, force - case.terms.bias)
    full = case.full
    rate = np.matvec(full.transform, acceleration)
    rate += np.matvec(full.transform_rate, case.velocity)
    left = np.matvec(full.inertia, rate) + np.matvec(full.coriolis, case.xi)
    left[:, :3] -= case.robot.model.opt.gravity
    assert_close(left, np.matvec(full.inverse_transform.mT, force), np.abs(case.terms.bias).max())


def test_eqs_16_17_22_inertia_is_block_diagonal(case):
    expected = case.full.inverse_transform.mT @ case.terms.mass_matrix @ case.full.inverse_transform
    assert_close(case.full.inertia, expected)
    matrix = case.body.matrix
    assert_close(momentum_inertia(case.body), np.linalg.inv(matrix @ case.inverse_mass @ matrix.mT))
    joints = np.linalg.inv(case.inverse_mass[:, 6:, 6:])
    assert_close(joint_inertia(case.body, case.terms.mass_matrix), joints)


def test_eq_18_from_its_definition(case):
    full = case.full
    force = np.matvec(case.coriolis, case.velocity)
    inner = np.matvec(full.transform @ case.inverse_mass, force)
    inner -= np.matvec(full.transform_rate, case.velocity)
    assert_close(np.matvec(full.coriolis, case.xi), np.matvec(full.inertia, inner))


def test_eq_15_and_25_coupling_of_velocities_is_skew(case):
    gamma = case.full.coriolis
    assert_zero(gamma[:, 6:, :6] + gamma[:, :6, 6:].mT, gamma)
    assert_zero(gamma[:, 3:6, :3] + gamma[:, :3, 3:6].mT, gamma)
    assert_zero(gamma[:, :3, :3] + gamma[:, :3, :3].mT, gamma)


def test_inertia_rate_less_twice_gamma_is_skew(case):
    def blocks(terms):
        body = centroidal_terms(terms, case.velocity)
        inertia = np.zeros_like(terms.mass_matrix)
        inertia[:, :6, :6] = momentum_inertia(body)
        inertia[:, 6:, 6:] = joint_inertia(body, terms.mass_matrix)
        return inertia

    rate, gamma = time_derivative(case, blocks), case.full.coriolis
    np.testing.assert_allclose(
        gamma + gamma.mT, rate, rtol=0.0, atol=1e-6 * max(1.0, np.abs(gamma).max())
    )


def test_eq_19_joints_do_not_push_the_momentum(case):
    gamma = case.full.coriolis[:, :6]
    assert_zero(np.matvec(gamma, case.xi), np.abs(gamma).max() * np.abs(case.xi).max())


def test_eq_21_angular_and_linear_rows_are_orthogonal(case):
    product = case.body.matrix[:, 3:] @ case.inverse_mass
    assert_zero(product @ case.body.matrix[:, :3].mT, product)


def test_eq_26_gravity_acts_on_the_linear_momentum_alone(case):
    transformed = np.matvec(case.full.inverse_transform.mT, case.gravity_force)
    expected = np.zeros_like(transformed)
    expected[:, :3] = -case.robot.model.opt.gravity
    assert_close(transformed, expected, np.abs(case.gravity_force).max())


def test_eqs_28_and_29_linear_inertia(case):
    linear = case.body.matrix[:, :3]
    expected = np.broadcast_to(np.eye(3) / case.robot.mass, (COUNT, 3, 3))
    assert_close(np.linalg.inv(linear @ case.inverse_mass @ linear.mT), expected)
    assert_close(momentum_inertia(case.body)[:, :3, :3], expected)
    at_com = linear / case.robot.mass
    assert_close(at_com @ case.inverse_mass @ at_com.mT, expected)


def test_eqs_30_and_32_wrench_at_the_com(case, rng):
    wrench = rng.normal(size=(COUNT, 6))
    assert_close(case.body.wrench_map, case.body.matrix.mT @ momentum_inertia(case.body))
    force = np.matvec(case.body.wrench_map, wrench)
    acceleration = np.matvec(case.inverse_mass, force - np.matvec(case.coriolis, case.velocity))
    rate = np.matvec(case.body.matrix, acceleration)
    rate += np.matvec(case.full.transform_rate[:, :6], case.velocity)
    assert_close(rate, wrench, np.abs(case.coriolis @ case.velocity[..., None]).max())


def test_eq_33_generalized_jacobian(case):
    jacobian, _ = point_jacobian(contact_geometry(case.robot), case.terms)
    transformed = transformed_jacobian(case.body, jacobian)
    assert_close(transformed, jacobian @ case.full.inverse_transform)
    joints = generalized_jacobian(case.terms.mass_matrix, jacobian)
    assert_close(transformed[:, :, 6:], joints)
    assert_close(joints, jacobian @ case.pseudo_inverse(case.selection))


def test_contact_forces_act_on_momentum_through_their_wrench(case, rng):
    # The identity behind eq. (38): Jbar_b^T f = Lambda_h (wrench of f at the centre of mass).
    geometry = contact_geometry(case.robot)
    force = rng.normal(size=(COUNT, geometry.num_points, 3))
    jacobian, _ = point_jacobian(geometry, case.terms)
    base = transformed_jacobian(case.body, jacobian)[:, :, :6]
    arm = point_positions(geometry, case.terms) - case.terms.com[:, None]
    wrench = np.concatenate([force.sum(1), np.cross(arm, force).sum(1)], axis=1)
    expected = np.matvec(momentum_inertia(case.body), wrench)
    assert_close(np.matvec(base.mT, force.reshape(COUNT, -1)), expected)


def test_appendix_pseudo_inverse_of_the_momentum_matrix_by_its_halves(case):
    """A^{+M} = M^-1 A^T blkdiag(Lambda_p, Lambda_l) = [A_p^{+M}, A_l^{+M}]."""
    matrix = case.body.matrix
    halves = [case.pseudo_inverse(matrix[:, part]) for part in (slice(3), slice(3, 6))]
    expected = case.pseudo_inverse(matrix)
    assert_close(np.concatenate(halves, axis=2), expected)
    assert_close(case.inverse_mass @ matrix.mT @ momentum_inertia(case.body), expected)


def test_eq_35_the_model_of_ott_2011(case, rng):
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
    assert_close(joints - eliminated, case.full.inertia[:, 6:, 6:], np.abs(joints).max())
    assert np.abs(eliminated).max() > 0.01 * np.abs(joints).max()
    # The angular momentum, of which (36) counts the hip's part alone.
    rates = np.matvec(change, case.velocity)
    angular = np.matvec(hip, rates[:, 3:6]) + np.matvec(coupling, rates[:, 6:])
    assert_close(angular, case.body.momentum[:, 3:])
    weight = np.matvec(back.mT, case.gravity_force)
    expected = np.zeros_like(weight)
    expected[:, :3] = -mass * case.robot.model.opt.gravity
    assert_close(weight, expected, np.abs(case.gravity_force).max())
    # (37): the base rows of the contacts' Jacobians add up to the wrench at the centre of mass.
    geometry = contact_geometry(case.robot)
    force = rng.normal(size=(COUNT, geometry.num_points, 3))
    jacobian, _ = point_jacobian(geometry, terms)
    total = np.matvec((jacobian @ back)[:, :, :6].mT, force.reshape(COUNT, -1))
    arm = point_positions(geometry, terms) - terms.com[:, None]
    assert_close(total, np.concatenate([force.sum(1), np.cross(arm, force).sum(1)], axis=1))


def test_eq_34_kinetic_energy_in_three_parts(case):
    energy = kinetic_energy(case.body, case.terms.mass_matrix, case.velocity)
    momentum = np.matvec(case.terms.mass_matrix, case.velocity)
    assert energy.shape == (COUNT, 3)
    assert (energy > 0.0).all()
    assert_close(energy.sum(axis=1), 0.5 * np.vecdot(case.velocity, momentum))


# --- simulation --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", robots.ROBOTS)
def test_in_flight_motors_move_joints_and_feet_but_not_the_momentum(name):
    """Gravity off, nothing touched: h stays zero, and Jbar qdot is the velocity of the feet."""
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
    for step in range(200):
        sign = 1.0 if step < 100 else -1.0
        data.ctrl[robot.actuator] = sign * torque / robot.gear
        mujoco.mj_step(model, data)
        if step % 20 == 19:
            velocity = data.qvel[None]
            terms = dynamics.terms(data.qpos[None], velocity)
            body = centroidal_terms(terms, velocity)
            size = np.abs(body.matrix[0] * data.qvel).sum(axis=1)
            assert (np.abs(body.momentum[0]) < 1e-6 * size).all()
            jacobian = generalized_jacobian(terms.mass_matrix, terms.foot_jacobian[:, 0])
            foot = np.matvec(jacobian, velocity[:, 6:])
            speed = np.abs(terms.foot_velocity[:, 0]).max()
            np.testing.assert_allclose(foot, terms.foot_velocity[:, 0], atol=1e-6 * speed)
            fastest = max(fastest, speed)
    assert fastest > 0.5
