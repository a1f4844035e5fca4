"""The model-based layers: what they ask for, what they promise, and what MuJoCo makes of it."""

import copy

import gymnasium as gym
import mujoco
import numpy as np
import pytest

from fbid_gym.actions import make_layer
from fbid_gym.control import ContactLimits, limited_inverse_dynamics, orthogonal_inverse_dynamics
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import reduced_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions import home_reference
from fbid_gym.quantities import RobotState

ENV = "fbid_gym/BipedBalance-v0"
LIMITS = ("friction", "none")


def settled(robot, count, layer="base_acceleration", seconds=4.0, **options):
    """Environments that have come to rest under the zero action."""
    env = gym.make_vec(
        ENV,
        robot=robot.name,
        num_envs=count,
        action_layer=layer,
        layer_options=options,
        push_force=(0, 0),
        episode_seconds=100.0,
    )
    env.reset(seed=0)
    for _ in range(round(50 * seconds)):
        env.step(np.zeros(env.action_space.shape))
    return env.chunks.batches[0]


def state_of(simulation):
    """Where the robots are, in arrays of their own."""
    seen = (simulation.qpos, simulation.qvel, simulation.contact_force)
    return RobotState(*(array.copy() for array in seen), np.zeros(len(simulation.qpos), np.int64))


def promised(layer, acceleration, terms, active=None):
    """What the inverse dynamics say of a desired acceleration: (torque, acceleration, forces)."""
    law = layer.law.constants
    priority = 1.0 / law.nearness.mobility[:6]
    contacts = reduced_contacts(law.geometry, terms, active)
    arguments = (
        terms.mass_matrix,
        terms.bias,
        contacts.jacobian,
        acceleration,
        contacts.bias,
    )
    if not layer.law.limited:
        free = orthogonal_inverse_dynamics(*arguments, base_priority=priority)
        forces = np.matvec(contacts.point_map.mT, free.contact_force)
        return free.torque, free.acceleration, forces.reshape(len(forces), -1, 3)
    limited = limited_inverse_dynamics(
        *arguments,
        ContactLimits(*law.limits[0].T),
        point_map=contacts.point_map,
        active=active,
        base_priority=priority,
        length=Stance.of(layer.law.robot).length,
    )
    return limited.torque, limited.acceleration, limited.point_force


@pytest.mark.parametrize("limits", LIMITS)
def test_predicted_contact_forces_are_measured_in_stance(robot, limits):
    """Point by point, to 1e-8 of the weight with limits and 1e-4 without (its feet creep)."""
    batch = settled(robot, 2, contact_limits=limits)
    terms, layer, state = batch.simulation.terms(), batch.layer, state_of(batch.simulation)
    acceleration = layer.acceleration(np.zeros((2, 6)), state, home_reference(robot), terms)
    _, _, forces = promised(layer, acceleration, terms)
    tolerance = {"friction": 1e-8, "none": 1e-4}[limits] * robot.weight
    np.testing.assert_allclose(forces, state.contact_force, atol=tolerance)
    assert forces[..., 2].min() > 0.1 * robot.weight / robot.num_points
    slide = np.linalg.norm(forces[..., :2], axis=-1)
    assert (slide <= 0.7 * forces[..., 2]).all()


@pytest.mark.parametrize("limits", LIMITS)
def test_promised_accelerations_come_true(robot, limits):
    """For 60 ms of each action: the velocity gained is the promised acceleration's integral.

    To 3 % in the direction of the action. MuJoCo's contacts are soft and give way a little as their
    load changes, which turns the feet: the ankles are off by up to 40 % of the largest velocity
    (g1's, whose soles are 6 cm narrow; 31 % the humanoid's, 20 % elsewhere).
    """
    batch = settled(robot, 6, contact_limits=limits)
    layer, simulation = batch.layer, batch.simulation
    action, memory = 0.1 * np.eye(6), layer.memory(6)
    start, gained = simulation.qvel.copy(), np.zeros_like(simulation.qvel)
    for _ in range(30):
        state, terms = state_of(simulation), simulation.terms()
        torque, acceleration, _ = promised(
            layer, layer.acceleration(action, state, home_reference(robot), terms), terms
        )
        ours = layer.torque(
            action, state, home_reference(robot), lambda: simulation.terms(), memory
        )
        compensated = torque + robot.joint_damping * state.qvel[:, 6:]
        np.testing.assert_allclose(ours, compensated, atol=2e-4 * robot.weight)
        gained += acceleration / 500.0
        simulation.step(ours)
    change = simulation.qvel - start
    for row, direction in enumerate(np.eye(6)):
        along = change[row, :6] @ direction
        assert along == pytest.approx(gained[row, :6] @ direction, rel=0.03) and along > 0.0
        everything = np.abs(change[row]).max()
        np.testing.assert_allclose(change[row], gained[row], atol=0.42 * everything)


def test_the_desired_acceleration_is_the_documented_law(robot, states, rng):
    """Springs and dampers to the home pose above the feet, in the level frame of the feet."""
    frequencies = {"balance": 0.7, "height": 1.3, "rotation": 1.7, "posture": 0.9}
    ratio = 0.8
    options = {f"{key}_frequency": value for key, value in frequencies.items()}
    layer = make_layer("base_acceleration", robot, 500, options | {"damping_ratio": ratio})
    state, terms = states(10, noise=0.2)
    action = rng.uniform(-1, 1, (10, 6))
    found = layer.acceleration(action, state, home_reference(robot), terms)
    w = {key: 2 * np.pi * value for key, value in frequencies.items()}
    home = MuJoCoDynamics(robot).terms(robot.home_qpos[None], np.zeros((1, robot.nv)))
    support = layer.stance
    home_frame = support.frame(home)
    for row in range(10):
        frame = support.frame(terms)
        level, centre = frame.world_from_support[row], frame.centre[row]
        com_error = home_frame.world_from_support[0].T @ (home.com[0] - home_frame.centre[0])
        com_error = com_error - level.T @ (terms.com[row] - centre)
        com_rate = level.T @ terms.com_velocity[row]
        height_error = home.base_position[0, 2] - home_frame.centre[0, 2]
        height_error -= terms.base_position[row, 2] - centre[2]
        linear = w["balance"] ** 2 * com_error - 2 * ratio * w["balance"] * com_rate
        linear[2] = w["height"] ** 2 * height_error
        linear[2] -= 2 * ratio * w["height"] * state.qvel[row, 2]
        # Rotation that is left to do, in the base's axes: axis times sine of the angle.
        left = terms.world_from_base[row].T @ level @ home.world_from_base[0]
        quaternion, turn = np.empty(4), np.empty(3)
        mujoco.mju_mat2Quat(quaternion, left.ravel())
        mujoco.mju_quat2Vel(turn, quaternion, 1.0)
        angle = np.linalg.norm(turn)
        angular = w["rotation"] ** 2 * turn / angle * np.sin(angle)
        angular -= 2 * ratio * w["rotation"] * state.qvel[row, 3:6]
        linear += layer.scale[:3] * action[row, :3]
        angular += layer.scale[3:] * action[row, 3:]
        posture = w["posture"] ** 2 * (robot.home_qpos[7:] - state.qpos[row, 7:])
        posture -= 2 * ratio * w["posture"] * state.qvel[row, 6:]
        expected = np.concatenate([level @ linear, angular, posture])
        np.testing.assert_allclose(found[row], expected, atol=1e-9)


def test_the_scale_of_the_action_is_what_the_stance_allows(robot):
    layer = make_layer("base_acceleration", robot, 500, {"friction": 0.5})
    support, gravity = layer.stance, 9.81
    ahead, sideways = support.margin
    height = support.home_com[2]
    home = MuJoCoDynamics(robot).terms(robot.home_qpos[None], np.zeros((1, robot.nv)))
    inertia = np.diag(home.mass_matrix[0])[3:6]
    assert layer.scale[0] == pytest.approx(min(gravity * ahead / height, 0.5 * gravity))
    assert layer.scale[1] == pytest.approx(min(gravity * sideways / height, 0.5 * gravity))
    assert layer.scale[2] == pytest.approx(0.5 * gravity)
    moments = robot.weight * np.array([sideways, ahead, 0.5 * support.radius])
    np.testing.assert_allclose(layer.scale[3:], moments / inertia)
    # As much as the support polygon allows: more would make the feet tip.
    if robot.name == "biped":
        assert 0.8 < layer.scale[0] < 2.0


def test_joint_accelerations_are_springs_to_home(robot, states, rng):
    """The acceleration that comes out keeps the feet in place and is nearest in the joints."""
    options = {"natural_frequency": 0.8, "damping_ratio": 0.6, "scale": 5.0}
    layer = make_layer("joint_acceleration", robot, 500, options | {"contact_limits": "none"})
    state, terms = states(6)
    action = rng.uniform(-1, 1, (6, robot.num_joints))
    w = 2 * np.pi * 0.8
    desired = np.zeros((6, robot.nv))
    desired[:, 6:] = w**2 * (robot.home_qpos[7:] - state.qpos[:, 7:])
    desired[:, 6:] += 5.0 * action - 2 * 0.6 * w * state.qvel[:, 6:]
    torque, acceleration, _ = promised(layer, desired, terms)
    ours = layer.torque(action, state, home_reference(robot), lambda: terms, layer.memory(6))
    compensated = torque + robot.joint_damping * state.qvel[:, 6:]
    np.testing.assert_allclose(ours, compensated, atol=1e-9 * robot.weight)
    contacts = reduced_contacts(layer.law.constants.geometry, terms)
    held = np.matvec(contacts.jacobian, acceleration) + contacts.bias
    np.testing.assert_allclose(held, 0.0, atol=1e-7)


@pytest.mark.parametrize("name", ["joint_acceleration", "base_acceleration"])
@pytest.mark.parametrize("limits", LIMITS)
def test_damping_is_compensated_exactly(robot, states, name, limits):
    """On the robot as it is, the layer does what it does without compensation on one undamped."""
    state, terms = states(3)
    options = {"contact_limits": limits}
    with_it = make_layer(name, robot, 500, options)
    without = make_layer(name, robot, 500, options | {"compensate_damping": False})
    action = np.zeros((3, len(with_it.action_names)))
    torques = [
        layer.torque(action, state, home_reference(robot), lambda: terms, layer.memory(3))
        for layer in (with_it, without)
    ]
    np.testing.assert_allclose(
        torques[0] - torques[1], robot.joint_damping * state.qvel[:, 6:], atol=1e-9
    )
    undamped = copy.copy(robot.model)
    undamped.dof_damping[:] = 0.0
    for row in range(3):
        accelerations = []
        for model, torque in zip((robot.model, undamped), torques, strict=True):
            data = mujoco.MjData(model)
            data.qpos[:], data.qvel[:] = state.qpos[row], state.qvel[row]
            data.qfrc_applied[6:] = torque[row]
            mujoco.mj_forward(model, data)
            accelerations.append(data.qacc_smooth.copy())
        np.testing.assert_allclose(*accelerations, rtol=1e-9, atol=1e-9)


def test_measured_contacts_are_the_points_that_carry_weight(robot, states):
    layer = make_layer("base_acceleration", robot, 500, {"contacts": "measured"})
    state, terms = states(4)
    force = state.contact_force.copy()
    force[1, 0] = 0.0
    force[2, :, 2] = 0.0
    force[3, 0] = [0.0, 0.0, 1e-3 * robot.weight]
    state = state._replace(contact_force=force)
    active = layer.law.belief(state, home_reference(robot)).mask
    expected = np.ones((4, robot.num_points), bool)
    expected[1, 0] = expected[3, 0] = False
    expected[2] = False
    np.testing.assert_array_equal(active, expected)
    desired = layer.acceleration(np.zeros((4, 6)), state, home_reference(robot), terms)
    torque, _, forces = promised(layer, desired, terms, active)
    assert (forces[~expected] == 0.0).all()
    assert (forces[0, :, 2] > 0.0).any()
    ours = layer.torque(
        np.zeros((4, 6)), state, home_reference(robot), lambda: terms, layer.memory(4)
    )
    compensated = torque + robot.joint_damping * state.qvel[:, 6:]
    np.testing.assert_allclose(ours, compensated, atol=1e-3 * robot.weight)


@pytest.mark.parametrize("limits", LIMITS)
def test_scheduled_contacts_take_turns(robot, states, limits):
    """Feet that the schedule lifts get no force, tick by tick and around the clock."""
    first, *others = robot.foot_names
    schedule = [(0.1, [first, *others]), (0.05, others), (0.03, [])]
    options = {"contacts": schedule, "contact_limits": limits}
    layer = make_layer("base_acceleration", robot, 500, options)
    ticks = np.arange(2 * 90)
    state, _ = states(1)
    counted = RobotState(*(np.repeat(value, len(ticks), axis=0) for value in state[:3]), ticks)
    active = layer.law.belief(counted, home_reference(robot)).mask
    phase = ticks % 90
    foot_of_point = layer.law.constants.geometry.foot_of_point
    on_first = np.isin(np.arange(robot.num_points), foot_of_point.nonzero()[0])
    expected = (phase < 50)[:, None] | ((phase < 75)[:, None] & on_first)
    np.testing.assert_array_equal(active, expected)

    terms = MuJoCoDynamics(robot).terms(counted.qpos, counted.qvel)
    desired = layer.acceleration(np.zeros((len(ticks), 6)), counted, home_reference(robot), terms)
    torque, _, forces = promised(layer, desired, terms, active)
    assert np.abs(forces[~active]).max() < 1e-12
    assert np.abs(forces[phase < 75]).max() > 0.1 * robot.weight / robot.num_points
    memory = layer.memory(len(ticks))
    ours = layer.torque(
        np.zeros((len(ticks), 6)), counted, home_reference(robot), lambda: terms, memory
    )
    compensated = torque + robot.joint_damping * counted.qvel[:, 6:]
    np.testing.assert_allclose(ours, compensated, atol=1e-3 * robot.weight)
    assert (memory["underactuation"][phase >= 75] == 6).all()
    assert (memory["underactuation"][phase < 50] == 0).all()


def test_limited_forces_stay_within_their_cones_whatever_is_asked(robot, states, rng):
    options = {"friction": 0.4, "min_normal_force": 0.01, "max_normal_force": 0.5}
    layer = make_layer("base_acceleration", robot, 500, options)
    state, terms = states(40, noise=0.3)
    desired = layer.acceleration(rng.uniform(-1, 1, (40, 6)), state, home_reference(robot), terms)
    desired += 30.0 * rng.normal(size=desired.shape)
    _, _, forces = promised(layer, desired, terms)
    slide, normal = np.linalg.norm(forces[..., :2], axis=-1), forces[..., 2]
    weight = robot.weight
    assert (slide <= 0.4 * normal + 1e-9 * weight).all()
    assert normal.min() >= (0.01 - 1e-12) * weight and normal.max() <= (0.5 + 1e-12) * weight
