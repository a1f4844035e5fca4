"""The acceleration layers: what they ask for, what they promise, and what MuJoCo makes of it."""

import copy
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from fbid_gym.control import ContactLimits, limited_inverse_dynamics, orthogonal_inverse_dynamics
from fbid_gym.control.body_law import Command, desired_acceleration, stabilise
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import reduced_contacts
from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.quantities import RobotState
from fbid_gym.robots import ROBOTS
from tests.actions.cases import home_of, layer_of, moving, torque_of
from tests.batches import begun
from tests.control.test_whole_body import boundless
from tests.pairs import pairs

ENV = "fbid_gym/BipedBalance-v0"
LIMITS = ("friction", "none")
either_limits = pytest.mark.parametrize(
    ("robot", "limits"), pairs(ROBOTS, LIMITS, 1), indirect=["robot"]
)


def settled(robot, count, seconds=4.0, **options):
    """Environments that have come to rest under the zero action."""
    given = {"layer_options": options, "push_force": (0, 0), "episode_seconds": 100.0}
    env = begun(ENV, count, robot=robot.name, action_layer="base_acceleration", **given)
    for _ in range(round(50 * seconds)):
        env.step(np.zeros(env.action_space.shape))
    return env.chunks.batches[0]


def state_of(simulation):
    """Where the robots are, in arrays of their own."""
    seen = (simulation.qpos, simulation.qvel, simulation.contact_force)
    return RobotState(*(array.copy() for array in seen), np.zeros(len(simulation.qpos), np.int64))


def asked(layer, action, state, target, terms):
    """The command of `base_acceleration`."""
    command = Command.to_target(layer.scale * action)
    return stabilise(layer.law.constants, command, state, target, terms)


def promised(layer, command, state, target, terms):
    """What the dense laws say of a command: (torque, acceleration, forces on the points)."""
    law, active = layer.law.constants, layer.law.belief(state, target)
    acceleration = desired_acceleration(law, command, state, target, terms, active)
    contacts = reduced_contacts(law.geometry, terms, active)
    # Feet that stand are slowed down by `hold`.
    slowed = contacts.bias + law.gains.hold * np.matvec(contacts.jacobian, state.qvel)
    motion = terms.mass_matrix, terms.bias, contacts.jacobian, acceleration, slowed
    priority = 1.0 / law.mobility[:6]
    if not layer.law.limited:
        free = orthogonal_inverse_dynamics(*motion, base_priority=priority)
        forces = np.matvec(contacts.point_map.mT, free.contact_force)
        return free.torque, free.acceleration, forces.reshape(len(forces), -1, 3)
    own = {"point_map": contacts.point_map, "active": active, "base_priority": priority}
    tilting, turning = np.broadcast_to(getattr(layer, "moment_priority", 1.0), 2)
    own |= {"wrench_cost": (1.0,) * 3 + (tilting, tilting, turning)}
    own |= {"length": Stance.of(layer.law.robot).length}
    limited = limited_inverse_dynamics(*motion, ContactLimits(*law.limits[0].T), **own)
    return limited.torque, limited.acceleration, limited.point_force


def wrenches(geometry, terms, forces):
    """Force and moment about its reference on every foot, of forces on points: (N, F, 6)."""
    found = np.zeros((*terms.foot_position.shape[:2], 6))
    for point, foot in enumerate(geometry.foot_of_point):
        arm = np.matvec(terms.world_from_foot[:, foot], geometry.offset[point])
        found[:, foot, :3] += forces[:, point]
        found[:, foot, 3:] += np.cross(arm, forces[:, point])
    return found


@pytest.mark.slow
@either_limits
def test_predicted_contact_forces_are_measured_in_stance(robot, limits):
    """Foot by foot, to 1e-8 of the weight with limits and 1e-4 without (its feet creep)."""
    batch = settled(robot, 2, contact_limits=limits)
    terms, layer, state = batch.simulation.terms(), batch.layer, state_of(batch.simulation)
    target = home_of(robot, terms)
    command = asked(layer, np.zeros((2, 6)), state, target, terms)
    _, _, forces = promised(layer, command, state, target, terms)
    said = wrenches(layer.law.constants.geometry, terms, forces)
    measured = wrenches(Stance.of(robot).geometry, terms, state.contact_force)
    tolerance = {"friction": 1e-8, "none": 1e-4}[limits] * robot.weight
    np.testing.assert_allclose(said, measured, atol=tolerance)
    assert said[..., 2].min() > 0.1 * robot.weight / robot.num_feet


@pytest.mark.slow
@either_limits
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
        target = home_of(robot, terms)
        command = asked(layer, action, state, target, terms)
        torque, acceleration, _ = promised(layer, command, state, target, terms)
        ours = layer.torque(action, state, target, lambda terms=terms: terms, memory)
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


def test_what_is_asked_is_the_documented_law(robot, states, rng):
    """Springs and dampers to a target that moves in all coordinates, and the action on top."""
    frequencies = {"balance": 0.7, "height": 1.3, "rotation": 1.7, "posture": 0.9}
    options = {f"{key}_frequency": value for key, value in frequencies.items()}
    layer = layer_of("base_acceleration", robot, **options, damping_ratio=0.8)
    state, terms = states(10, noise=0.2)
    target, action = moving(robot, terms, rng), rng.uniform(-1, 1, (10, 6))
    found = asked(layer, action, state, target, terms)
    w = {key: 2 * np.pi * value for key, value in frequencies.items()}

    def pulled(key, acceleration, gap, rate):
        return acceleration + w[key] ** 2 * gap + 2 * 0.8 * w[key] * rate

    wanted, added = quaternion_to_matrix(target.qpos[:, 3:7]), layer.scale * action
    late, fallen = target.qvel - state.qvel, target.qpos[:, 2] - terms.base_position[:, 2]
    slow = target.com_velocity - terms.com_velocity
    com = pulled("balance", target.com_acceleration, target.com - terms.com, slow)
    com[:, 2] = pulled("height", target.qacc[:, 2], fallen, late[:, 2])
    away = (target.qpos - state.qpos)[:, 7:]
    joints = pulled("posture", target.qacc[:, 6:], away, late[:, 6:])
    np.testing.assert_allclose(found.reference[:, 6:], joints, atol=1e-9)
    for row, linear in enumerate(com):
        ahead = wanted[row] @ base_from_trunk(robot)[:, 0]
        cosine, sine = ahead[:2] / np.hypot(*ahead[:2])
        linear[:2] += np.array([[cosine, -sine], [sine, cosine]]) @ added[row, :2]
        linear[2] += added[row, 2]
        # Rotation that is left to do, in the base's axes: axis times sine of the angle.
        left = terms.world_from_base[row].T @ wanted[row]
        quaternion, turn = np.empty(4), np.empty(3)
        mujoco.mju_mat2Quat(quaternion, left.ravel())
        mujoco.mju_quat2Vel(turn, quaternion, 1.0)
        angle = np.linalg.norm(turn)
        spin = left @ target.qvel[row, 3:6] - state.qvel[row, 3:6]
        angular = pulled("rotation", target.qacc[row, 3:6], turn / angle * np.sin(angle), spin)
        body = np.concatenate([linear, angular + added[row, 3:]])
        np.testing.assert_allclose(found.body[row], body, atol=1e-9)


def test_the_scale_of_the_action_is_what_the_stance_allows(robot):
    layer = layer_of("base_acceleration", robot, friction=0.5)
    support, gravity = Stance.of(robot), 9.81
    ahead, sideways = support.margin
    height = support.home_com[2]
    inertia = np.diag(support.terms.mass_matrix[0])[3:6]
    assert layer.scale[0] == pytest.approx(min(gravity * ahead / height, 0.5 * gravity))
    assert layer.scale[1] == pytest.approx(min(gravity * sideways / height, 0.5 * gravity))
    assert layer.scale[2] == pytest.approx(0.5 * gravity)
    moments = robot.weight * np.array([sideways, ahead, 0.5 * support.radius])
    np.testing.assert_allclose(layer.scale[3:], moments / inertia)
    # As much as the support polygon allows: more would make the feet tip.
    if robot.name == "biped":
        assert 0.8 < layer.scale[0] < 2.0


def test_joint_accelerations_are_springs_to_their_target(robot, states, rng):
    """The acceleration that comes out keeps the feet in place and is nearest in the joints."""
    options = {"natural_frequency": 0.8, "damping_ratio": 0.6, "scale": 5.0}
    layer = layer_of("joint_acceleration", robot, **options, contact_limits="none")
    state, terms = states(6)
    target, action = moving(robot, terms, rng), rng.uniform(-1, 1, (6, robot.num_joints))
    w = 2 * np.pi * 0.8
    desired = np.zeros((6, robot.nv))
    desired[:, 6:] = target.qacc[:, 6:] + w**2 * (target.qpos[:, 7:] - state.qpos[:, 7:])
    desired[:, 6:] += 2 * 0.6 * w * (target.qvel[:, 6:] - state.qvel[:, 6:]) + 5.0 * action
    law = layer.law.constants
    contacts = reduced_contacts(law.geometry, terms)
    motion = terms.mass_matrix, terms.bias, contacts.jacobian, desired, contacts.bias
    free = orthogonal_inverse_dynamics(*motion, base_priority=1.0 / law.mobility[:6])
    ours = torque_of(layer, state, target, terms, action)
    compensated = free.torque + robot.joint_damping * state.qvel[:, 6:]
    # To the ridge that the law's legs have, 1e-8.
    np.testing.assert_allclose(ours, compensated, atol=1e-7 * robot.weight)
    held = np.matvec(contacts.jacobian, free.acceleration) + contacts.bias
    np.testing.assert_allclose(held, 0.0, atol=1e-7)


@pytest.mark.parametrize(
    ("robot", "name", "limits"),
    pairs(ROBOTS, [("joint_acceleration", "friction"), ("base_acceleration", "none")], 1),
    indirect=["robot"],
)
def test_damping_is_compensated_exactly(robot, states, name, limits):
    """On the robot as it is, the layer does what it does without compensation on one undamped."""
    state, terms = states(3)
    target = home_of(robot, terms)
    torques = []
    for given in (True, False):
        layer = layer_of(name, robot, contact_limits=limits, compensate_damping=given)
        torques.append(torque_of(layer, state, target, terms))
    lost = robot.joint_damping * state.qvel[:, 6:]
    np.testing.assert_allclose(torques[0] - torques[1], lost, atol=1e-9)
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
    layer = layer_of("base_acceleration", robot, contacts="measured")
    state, terms = states(4)
    force = state.contact_force.copy()
    force[1, 0] = 0.0
    force[2, :, 2] = 0.0
    force[3, 0] = [0.0, 0.0, 1e-3 * robot.weight]
    state, target = state._replace(contact_force=force), home_of(robot, terms)
    expected = np.ones((4, robot.num_points), bool)
    expected[1, 0] = expected[3, 0] = False
    expected[2] = False
    np.testing.assert_array_equal(layer.law.belief(state, target), expected)
    memory = layer.memory(4)
    layer.torque(np.zeros((4, 6)), state, target, lambda: terms, memory)
    assert memory["underactuation"][2] == 6 and memory["underactuation"][0] == 0


def test_scheduled_contacts_take_turns(robot, states):
    """Feet that the schedule lifts get no force, tick by tick and around the clock."""
    first, *others = robot.foot_names
    schedule = [(0.1, [first, *others]), (0.05, others), (0.03, [])]
    layer = layer_of("base_acceleration", robot, contacts=schedule, notice_slip=False)
    layer = replace(layer, law=boundless(layer.law))  # the dense law knows no limits of motors
    ticks = np.arange(2 * 90)
    state, _ = states(1)
    counted = RobotState(*(np.repeat(value, len(ticks), axis=0) for value in state[:3]), ticks)
    terms = MuJoCoDynamics(robot).terms(counted.qpos, counted.qvel)
    target = home_of(robot, terms)
    active = layer.law.belief(counted, target)
    phase = ticks % 90
    foot_of_point = layer.law.constants.geometry.foot_of_point
    on_first = np.isin(np.arange(robot.num_points), foot_of_point.nonzero()[0])
    expected = (phase < 50)[:, None] | ((phase < 75)[:, None] & on_first)
    np.testing.assert_array_equal(active, expected)

    command = asked(layer, np.zeros((len(ticks), 6)), counted, target, terms)
    torque, _, forces = promised(layer, command, counted, target, terms)
    assert np.abs(forces[~active]).max() < 1e-12
    memory = layer.memory(len(ticks))
    ours = layer.torque(np.zeros((len(ticks), 6)), counted, target, lambda: terms, memory)
    compensated = torque + robot.joint_damping * counted.qvel[:, 6:]
    # Where a foot is in the air the dense law does not keep it from yielding to limits, and legs
    # with joints to spare yield by themselves there.
    limbs, down = layer.law.constants.limbs, phase < 50
    if (limbs.legs >= 0).sum(axis=1).max() <= limbs.rows.max():
        np.testing.assert_allclose(ours[down], compensated[down], atol=1e-3 * robot.weight)
    assert (memory["underactuation"][phase >= 75] == 6).all()
    assert (memory["underactuation"][down] == 0).all()
