"""What every action layer promises, and the formulas of those that need no model."""

import numpy as np
import pytest

from fbid_gym.actions import LAYERS
from fbid_gym.actions.com_wrench import BALANCERS
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry, point_jacobian
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions import in_world
from fbid_gym.robots import ROBOTS
from tests import postures
from tests.actions.cases import at_rest, home_of, layer_of, planned, torque_of
from tests.control.systems import equation_15
from tests.pairs import pairs

OPTIONS = [
    *((layer, {}) for layer in LAYERS),
    ("task_space_position", {"gravity": True}),
    ("joint_position_feedforward", {"contact_limits": "none", "balance_frequency": 0.0}),
    ("joint_position_feedforward", {"contacts": "measured", "contact_ramp": 0.01}),
    ("joint_acceleration", {"contacts": "measured"}),
    ("base_acceleration", {"contacts": "measured", "contact_limits": "none"}),
    ("com_wrench", {"contacts": "measured", "contact_ramp": 0.01}),
    ("com_wrench", {"balancer": "garofalo2015", "contacts": "measured"}),
    ("com_wrench", {"balancer": "ott2011", "contact_limits": "none"}),
]
every_layer = pytest.mark.parametrize(
    ("name", "options", "robot"), pairs(OPTIONS, ROBOTS), indirect=["robot"]
)
FREE = {"contact_limits": "none"}
UNLIMITED, UPRIGHT = ("torque", "joint_position"), "task_space_position"
FREELY = [(name, {} if name in UNLIMITED else FREE) for name in LAYERS if name != UPRIGHT]


def holding_torque(robot):
    """Least torques of the home stance, from the weight projected off the contacts, [M10] (15)."""
    _, terms = at_rest(robot)
    jacobian = point_jacobian(contact_geometry(robot), terms)[0][0]
    return equation_15(terms.mass_matrix[0], terms.bias[0], jacobian, np.zeros(robot.nv))[0]


@every_layer
def test_flight_is_no_special_case(robot, states, name, options):
    """Half a metre up and tumbling, whatever the layer takes to be on the ground."""
    layer = layer_of(name, robot, **options)
    state, _ = states(16, noise=0.3)
    state.qpos[:, 2] += 0.5
    state.qvel[:, 2] += 2.0
    terms = MuJoCoDynamics(robot).terms(state.qpos, state.qvel)
    state = state._replace(contact_force=np.zeros_like(state.contact_force))
    memory = layer.memory(16)
    zero, home = np.zeros((16, len(layer.action_names))), home_of(robot, terms)
    torque = layer.torque(zero, state, home, lambda: terms, memory)
    assert np.isfinite(torque).all()
    assert np.abs(torque / robot.torque_limit).max() < 100.0
    if options.get("contacts") == "measured":
        np.testing.assert_array_equal(memory["underactuation"], 6.0)


@pytest.mark.parametrize(("name", "options", "robot"), pairs(FREELY, ROBOTS), indirect=["robot"])
def test_the_zero_action_at_home_is_the_least_torque_that_holds_it(robot, name, options):
    layer = layer_of(name, robot, **options)
    state, terms = at_rest(robot)
    torque = torque_of(layer, state, home_of(robot, terms), terms)[0]
    expected = holding_torque(robot)
    np.testing.assert_allclose(torque, expected, atol=1e-6 * robot.weight)
    assert np.abs(expected).max() > 1e-3 * robot.weight


LIMITED = [(name, {}) for name in [*LAYERS][len(UNLIMITED) :]]
LIMITED += [("com_wrench", {"balancer": own}) for own in BALANCERS]


@pytest.mark.parametrize(("name", "options", "robot"), pairs(LIMITED, ROBOTS), indirect=["robot"])
def test_with_limited_forces_the_zero_action_at_home_holds_it_too(robot, name, options):
    """Other torques than the least, as contact forces are the least or upright: an equilibrium."""
    layer = layer_of(name, robot, **options)
    state, terms = at_rest(robot)
    torque = torque_of(layer, state, home_of(robot, terms), terms)[0]
    jacobian = point_jacobian(contact_geometry(robot), terms)[0][0]
    rest = terms.bias[0] - np.concatenate([np.zeros(6), torque])
    forces = np.linalg.lstsq(jacobian.T, rest, rcond=1e-9)[0]
    np.testing.assert_allclose(jacobian.T @ forces, rest, atol=2e-4 * robot.weight)
    normal = forces.reshape(-1, 3)[:, 2]
    assert (normal > 0.0).all() and normal.sum() == pytest.approx(robot.weight, rel=1e-3)


def test_torque_adds_to_the_holding_torque(robot, states, rng):
    layer = layer_of("torque", robot)
    state, terms = states(3)
    action = rng.uniform(-1, 1, (3, robot.num_joints))
    expected = holding_torque(robot) + action * robot.torque_limit
    torque = torque_of(layer, state, home_of(robot, terms), terms, action)
    np.testing.assert_allclose(torque, expected, atol=1e-6 * robot.weight)


def test_joint_position_is_a_pd_controller(robot, states, rng):
    layer = layer_of("joint_position", robot, natural_frequency=1.2, scale=0.2)
    assert (layer.gains.stiffness > 0.0).all() and (layer.gains.damping > 0.0).all()
    state, terms = states(4)
    action = rng.uniform(-1, 1, (4, robot.num_joints))
    target = robot.home_qpos[7:] + 0.2 * action
    expected = holding_torque(robot) + layer.gains.stiffness * (target - state.qpos[:, 7:])
    expected -= layer.gains.damping * state.qvel[:, 6:]
    torque = torque_of(layer, state, home_of(robot, terms), terms, action)
    np.testing.assert_allclose(torque, expected, atol=1e-5 * robot.weight)


def test_joint_position_gains_follow_from_the_inertia_a_joint_moves_in_stance(robot):
    """K_P = I w^2, with I found here by moving one joint while its foot stays where it is."""
    frequency, ratio, control_hz = 2.0, 0.7, 100_000
    options = {"natural_frequency": frequency, "damping_ratio": ratio}
    layer = layer_of("joint_position", robot, control_hz, **options)
    _, terms = at_rest(robot)
    omega = 2 * np.pi * frequency
    matrix = terms.mass_matrix[0]
    for joint in range(robot.num_joints):
        moved = np.abs(terms.foot_jacobian[0, :, :, 6 + joint]).max(axis=1) > 0
        if moved.any():
            foot = terms.foot_jacobian[0, np.flatnonzero(moved)[0]]
            velocity = np.zeros(robot.nv)
            velocity[6 + joint] = 1.0
            velocity[:6] = np.linalg.lstsq(foot[:, :6], -foot[:, 6 + joint], rcond=None)[0]
            assert np.abs(foot @ velocity).max() < 1e-12
            inertia = velocity @ matrix @ velocity / robot.num_feet
        else:
            inertia = matrix[6 + joint, 6 + joint]
        assert layer.gains.stiffness[joint] == pytest.approx(inertia * omega**2)
        assert layer.gains.damping[joint] == pytest.approx(2 * ratio * omega * inertia)


def test_a_light_joint_does_not_soften_the_others(robot):
    """A joint has the stiffness that is asked for, or a share of its own dead-beat gains."""
    fast = layer_of("joint_position", robot, 100_000, natural_frequency=1.0)
    _, terms = at_rest(robot)
    inertia = 1.0 / np.diag(np.linalg.inv(terms.mass_matrix[0]))[6:]
    for control_hz in (50, 250, 1000):
        layer = layer_of("joint_position", robot, control_hz)
        stiffness, damping = layer.gains.stiffness, layer.gains.damping
        wanted = fast.gains.stiffness * layer.natural_frequency**2
        share, soft = stiffness / (inertia * control_hz**2), stiffness < 0.999 * wanted
        np.testing.assert_allclose(stiffness[~soft], wanted[~soft], rtol=1e-3)
        assert share.max() <= 1.0
        np.testing.assert_allclose(share[soft], share.max(), rtol=1e-6)
        np.testing.assert_allclose(damping[soft] * control_hz, 1.5 * stiffness[soft], rtol=1e-6)


def test_joint_position_does_not_oscillate_in_the_air(robot):
    """Sampled and held over a tick, on all joints at once: every mode decays."""
    _, terms = at_rest(robot)
    mobility, one = np.linalg.inv(terms.mass_matrix[0])[6:, 6:], np.eye(robot.num_joints)
    for control_hz in (50, 100, 250, 500, 1000):
        layer, tick = layer_of("joint_position", robot, control_hz), 1.0 / control_hz
        stiff, damp = mobility * layer.gains.stiffness, mobility * layer.gains.damping
        here = [one - tick**2 / 2 * stiff, tick * one - tick**2 / 2 * damp]
        step = np.block([here, [-tick * stiff, one - tick * damp]])
        assert np.abs(np.linalg.eigvals(step)).max() < 1.0, control_hz


FOLLOWING = [
    ("joint_position", {}),
    ("joint_position_feedforward", {}),
    ("joint_acceleration", {"contact_limits": "none"}),
    ("base_acceleration", {}),
    ("base_acceleration", {"contact_limits": "none"}),
    ("com_wrench", {}),
    ("com_wrench", {"balancer": "garofalo2015"}),
    ("com_wrench", {"balancer": "ott2011", "contact_limits": "none"}),
]


def turned(state, angle):
    """The same robots elsewhere, turned about the vertical by `angle`."""
    qpos, rotation = postures.turned(state.qpos, angle, np.array([3.0, -2.0, 0.0]))
    qvel = state.qvel.copy()
    qvel[:, :3] = qvel[:, :3] @ rotation.T
    return state._replace(qpos=qpos, qvel=qvel)


@pytest.mark.parametrize(("name", "options", "robot"), pairs(FOLLOWING, ROBOTS), indirect=["robot"])
def test_which_way_a_robot_faces_does_not_matter(robot, states, name, options, rng):
    layer = layer_of(name, robot, **options)
    state, terms = states(6)
    action, motion = rng.uniform(-1, 1, (6, len(layer.action_names))), planned(robot, 6, rng)
    heading = Stance.of(robot).heading
    here = torque_of(layer, state, in_world(heading, motion, terms), terms, action)
    for angle in (0.7, 2.9, -1.8):
        elsewhere = turned(state, angle)
        known = MuJoCoDynamics(robot).terms(elsewhere.qpos, elsewhere.qvel)
        there = torque_of(layer, elsewhere, in_world(heading, motion, known), known, action)
        np.testing.assert_allclose(there, here, atol=1e-6 * robot.weight)
