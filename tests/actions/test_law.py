"""The law that model-based layers share: what its commands do to body and momentum, by MuJoCo."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fbid_gym import robots
from fbid_gym.actions import make_layer
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.gains import default_gains
from fbid_gym.actions.law import BodyLaw
from fbid_gym.control import operational_space_acceleration
from fbid_gym.control.body_law import Command, desired_acceleration
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.gait.gait import gait_of
from fbid_gym.motions.target import MotionKind, standing_target
from tests.actions.cases import layer_of, state_at, without_self_motion
from tests.postures import bent, posed, turned, without

HZ = 250


@pytest.fixture(scope="module", params=["go1", "biped"])
def robot(request):
    return robots.load(request.param)


def kind_of(robot):
    return MotionKind(True, gait_of(robot, HZ).omega)


def law_of(robot):
    gains = default_gains(robot, kind_of(robot))
    contact = ContactOptions(friction=0.6, compensate_damping=False, contact_ramp=0.0)
    contact = contact.on(robot, kind_of(robot))
    return BodyLaw.of(robot, HZ, contact, gains, 1.0)


def crouched(robot, rng, noise):
    """A robot on bent legs, all of it in motion."""
    qpos, qvel = bent(robot)[None].copy(), noise * rng.normal(size=(1, robot.nv))
    qpos[:, 7:] += noise * rng.normal(size=(1, robot.num_joints))
    turn = np.array([1.0, 0.0, 0.0, 0.4]) + noise * np.array([0.0, *rng.normal(size=3)])
    qpos[:, 3:7] = turn / np.linalg.norm(turn)
    return state_at(robot, qpos, qvel, carried=0.0)


def target_of(robot, terms, rng):
    """The first foot is in the air, on its way somewhere; the body is where it shall be."""
    target = standing_target(terms, robot.home_qpos)
    target.planted[0, 0], target.load[0, 0] = False, 0.0
    target.foot_position[0, 0] += 0.01 * rng.normal(size=3)
    target.foot_velocity[0, 0], target.foot_acceleration[0, 0] = 0.1 * rng.normal(size=(2, 6))
    return target


def command_of(robot, rng, push=None):
    """Accelerations of joints and body, and a push if the momentum is commanded."""
    reference = np.concatenate([np.zeros(6), rng.normal(size=robot.num_joints)])[None]
    pushed = np.empty((0, 6)) if push is None else np.asarray(push, float)[None]
    return Command(reference, rng.normal(size=(1, 6)), pushed)


def acceleration_of(law, command, state, target, terms):
    active = law.belief(state, target)
    return desired_acceleration(law.constants, command, state, target, terms, active)[0]


def momentum(robot, qpos, qvel):
    """Of the whole robot about its centre of mass; by MuJoCo."""
    data = posed(robot, qpos, qvel)
    mujoco.mj_subtreeVel(robot.model, data)
    mass = robot.model.body_subtreemass[1]
    return np.concatenate([mass * data.subtree_linvel[1], data.subtree_angmom[1]])


def momentum_rate(robot, state, acceleration, step=1e-5):
    """By a difference along a motion with this acceleration."""
    found = []
    for time in (step, -step):
        qpos = state.qpos[0].copy()
        way = time * state.qvel[0] + 0.5 * time**2 * acceleration
        mujoco.mj_integratePos(robot.model, qpos, way, 1.0)
        found.append(momentum(robot, qpos, state.qvel[0] + time * acceleration))
    return (found[0] - found[1]) / (2 * step)


def rate_of(law, command, state, target, terms):
    """What a command makes of the momentum."""
    return momentum_rate(law.robot, state, acceleration_of(law, command, state, target, terms))


def level(target):
    """(3, 3) rotation to the heading of a target whose base is upright."""
    heading = 2.0 * np.arctan2(target.qpos[0, 6], target.qpos[0, 3])
    return Rotation.from_euler("z", heading).as_matrix()


def test_what_is_asked_of_the_body_is_what_it_does(robot, rng):
    """Horizontally of its centre of mass, else of the base."""
    state, terms = crouched(robot, rng, 0.2)
    command = command_of(robot, rng)
    found = acceleration_of(law_of(robot), command, state, target_of(robot, terms, rng), terms)
    rate = momentum_rate(robot, state, found)
    np.testing.assert_allclose(rate[:2] / robot.mass, command.body[0, :2], atol=1e-5)
    np.testing.assert_allclose(found[2:6], command.body[0, 2:], atol=1e-6)


def test_a_push_adds_to_the_rate_of_the_momentum_along_the_heading(robot, rng):
    state, terms = crouched(robot, rng, 0.1)
    law, target = law_of(robot), target_of(robot, terms, rng)
    push = robot.weight * np.array([0.1, -0.05, 0.2, 0.01, -0.01, 0.005])
    command = command_of(robot, rng, np.zeros(6))
    pushed = command._replace(push=push[None])
    rates = [rate_of(law, each, state, target, terms) for each in (command, pushed)]
    turn = level(target)
    expected = np.concatenate([turn @ push[:3], turn @ push[3:]])
    # Armature on the joints is no part of the momentum.
    np.testing.assert_allclose(rates[1] - rates[0], expected, atol=1e-4 * robot.weight)


def test_without_errors_the_momentum_is_that_of_carrying_the_body_while_the_feet_swing(robot, rng):
    """At its height, upright, as fast as it shall be: nothing to add to the motion itself."""
    state, _ = crouched(robot, rng, 0.1)
    state.qpos[0, 3:7] = np.cos(0.2), 0.0, 0.0, np.sin(0.2)
    state.qvel[:] = 0.0
    terms = MuJoCoDynamics(robot).terms(state.qpos, state.qvel)
    law, target = law_of(robot), target_of(robot, terms, rng)
    target.foot_velocity[:] = 0.0
    command = command_of(robot, rng)
    found = acceleration_of(law, command._replace(push=np.zeros((1, 6))), state, target, terms)
    carried = acceleration_of(law, command, state, target, terms)
    np.testing.assert_allclose(found, carried, atol=1e-6 * np.abs(carried).max())


def test_a_moment_turns_the_base_back_and_a_force_lifts_it(robot, rng):
    state, terms = crouched(robot, rng, 0.0)
    law, target = law_of(robot), target_of(robot, terms, rng)
    rise, angle = 0.02, 0.3
    qpos = turned(target.qpos, angle)[0]
    qpos[0, :3] = target.qpos[0, :3] + [0.0, 0.0, rise]
    moved = target._replace(qpos=qpos)
    command = command_of(robot, rng, np.zeros(6))
    there, here = (rate_of(law, command, state, aimed, terms) for aimed in (moved, target))
    gains, inertia = law.constants.gains, law.constants.turning_inertia
    force = gains.height * rise * robot.mass
    moment = gains.rotation * np.sin(angle) * level(moved) @ inertia[:, 2]
    size = 1e-4 * robot.weight
    np.testing.assert_allclose((there - here)[2], force, atol=size)
    np.testing.assert_allclose((there - here)[3:], moment, atol=size)


def test_the_momentum_is_damped_towards_that_of_the_target(robot, rng):
    """Vertically and in rotation: of what is late, a share a second is made up for."""
    state, terms = crouched(robot, rng, 0.0)
    law, target = law_of(robot), target_of(robot, terms, rng)
    target.foot_velocity[:] = 0.0
    moved = target._replace(qvel=target.qvel.copy())
    moved.qvel[0, 2:6] = 0.1, 0.2, -0.1, 0.3
    command = command_of(robot, rng, np.zeros(6))
    there, here = (rate_of(law, command, state, aimed, terms) for aimed in (moved, target))
    # The momentum of a robot that is carried along so, its feet where they are.
    size = 6 if robot.has_soles else 3
    feet = terms.foot_jacobian[:, :, :size].reshape(1, -1, robot.nv)
    body = np.concatenate([terms.mass_matrix[0, :2] / robot.mass, np.eye(6, robot.nv)[2:]])
    spin = level(target) @ moved.qvel[0, 3:6]
    asked = np.concatenate([[0.0, 0.0, 0.1], terms.world_from_base[0].T @ spin])[None]
    own = without_self_motion(body, robot, terms, 0)
    given, cost = (feet, np.zeros(feet.shape[:2]), own, None, asked), 1.0 / law.constants.mobility
    carried = operational_space_acceleration(*given, motion_cost=cost)
    late = momentum(robot, state.qpos[0], carried.motion[0])
    gains, change = law.constants.gains, there - here
    np.testing.assert_allclose(change[2], gains.height_damping * late[2], rtol=1e-3)
    size = np.abs(change[3:]).max()
    np.testing.assert_allclose(change[3:], gains.rotation_damping * late[3:], atol=1e-3 * size)


@pytest.mark.parametrize("name", ["base_acceleration", "com_wrench"])
def test_small_errors_of_velocity_are_answered_by_the_gain_and_greater_ones_by_no_more(
    robot, name, rng
):
    gain, zero = 5.0, np.zeros((1, 6))
    state, terms = crouched(robot, rng, 0.1)
    kind = kind_of(robot)
    slow = 0.03 * robot.gravity / kind.omega
    layers = [make_layer(name, robot, HZ, kind, {"velocity_gain": size})[0] for size in (gain, 0.0)]
    towards = np.array([0.6, -0.8])
    for size, counts in ((0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (7.0, 1.0)):
        target = target_of(robot, terms, rng)
        target.com_velocity[:, :2] = state.qvel[:, :2] + size * slow * towards
        asked = [layer.desired(zero, state, target, terms)[0] for layer in layers]
        expected = np.append(gain * kind.omega * counts * slow * towards, 0.0)
        np.testing.assert_allclose(asked[0] - asked[1], expected, atol=1e-6)


@pytest.mark.parametrize("name", ["base_acceleration", "com_wrench"])
def test_the_velocity_that_is_damped_is_that_of_the_base_or_of_the_centre_of_mass(robot, name, rng):
    zero, kind = np.zeros((1, 6)), kind_of(robot)
    state, terms = crouched(robot, rng, 0.3)
    target, asked = target_of(robot, terms, rng), []
    for whose in ("base", "com", None):
        options = {"balance_frequency": (2.0, 3.0), "velocity_of": whose, "velocity_gain": 0}
        layer, _ = make_layer(name, robot, HZ, kind, options)
        asked.append(layer.desired(zero, state, target, terms)[0])
    apart = terms.com_velocity[0, :2] - state.qvel[0, :2]
    assert np.abs(apart).max() > 1e-3
    np.testing.assert_allclose(asked[0] - asked[1], np.append(3.0 * apart, 0.0), atol=1e-9)
    np.testing.assert_array_equal(asked[2], asked[0])


def test_an_offset_of_the_velocity_would_be_the_same_action_in_other_units(robot, rng):
    """By the damping that any error has; on soles, where it has none, it would do nothing."""
    state, terms = crouched(robot, rng, 0.1)
    target = target_of(robot, terms, rng)
    layer, _ = make_layer("base_acceleration", robot, HZ, kind_of(robot), {"velocity_gain": 0})
    offset, action = rng.normal(size=2), np.zeros((1, 6))
    moved = target._replace(com_velocity=target.com_velocity.copy())
    moved.com_velocity[0] += level(target) @ np.append(offset, 0.0)
    damping = layer.law.constants.gains.balance_damping
    assert (damping > 0.0) != robot.has_soles
    action[:, :2] = damping * offset * layer.per_acceleration
    torques = [
        layer.torque(own, state, aimed, lambda: terms, layer.memory(1))
        for own, aimed in ((np.zeros((1, 6)), moved), (action, target))
    ]
    np.testing.assert_allclose(*torques, atol=1e-7 * robot.torque_limit.max())


@pytest.mark.parametrize("name", ["base_acceleration", "com_wrench"])
def test_the_priority_may_be_the_policys(name, rng):
    """Zero is the layer's own; one more entry of the action is four times it, or a quarter."""
    robot = robots.load("go1")
    state, terms = crouched(robot, rng, 0.1)
    target = target_of(robot, terms, rng)
    target.planted[:, [0, 3]] = False  # a trot's pair: not all of force and moment can be had
    target.load[:, [0, 3]] = 0.0
    kind, push = kind_of(robot), 0.3 * rng.uniform(-1.0, 1.0, (1, 6))

    def torque(entries, **options):
        layer, _ = make_layer(name, robot, HZ, kind, options)
        action, memory = np.append(push, entries)[None], layer.memory(1)
        return layer, layer.torque(action, state, target, lambda: terms, memory)

    own, plain = torque([])
    layer, same = torque([0.0], priority_action=True)
    assert len(layer.action_names) == len(own.action_names) + 1
    np.testing.assert_array_equal(same, plain)
    for entry, factor in ((1.0, 4.0), (-1.0, 0.25), (0.5, 2.0)):
        _, asked = torque([entry], priority_action=True)
        _, given = torque([], moment_priority=factor * own.moment_priority)
        np.testing.assert_allclose(asked, given, atol=1e-9 * robot.weight)
        assert np.abs(asked - plain).max() > 1e-3 * np.abs(plain).max()


def test_moments_that_turn_may_weigh_apart(rng):
    """The more they weigh, the less of the one about the vertical is missing, on one sole."""
    robot, missing, torques = robots.load("biped"), [], []
    state, terms = crouched(robot, rng, 0.05)
    target, action = target_of(robot, terms, rng), np.array([[0.5, 0.5, 0.0, 0.0, 0.0, 3.0]])
    for priority in (0.05, (0.05, 0.05), (0.05, 0.5), (0.05, 50.0)):
        options = {"moment_priority": priority, "contact_ramp": 0.0}
        layer, _ = make_layer("base_acceleration", robot, HZ, kind_of(robot), options)
        memory, asked = layer.memory(1), Command.to_target(layer.scale * action)
        torques.append(layer.torque(action, state, target, lambda: terms, memory))
        wanted = acceleration_of(layer.law, asked, state, target, terms)
        missing.append(abs(terms.mass_matrix[0, 5] @ (wanted - memory["acceleration"][0])))
    np.testing.assert_array_equal(torques[0], torques[1])
    assert missing[1] > 1.5 * missing[2] > 3.0 * missing[3]


@pytest.mark.parametrize("name", ["biped", "humanoid", "zoo:biped:1"])
def test_on_soles_a_moment_weighs_like_the_force_that_takes_the_same_shift_of_pressure(name):
    robot = robots.load(name)
    layer, _ = make_layer("base_acceleration", robot, HZ, kind_of(robot), {})
    scale, height = layer.law.constants.nearness, robot.gravity / Stance.of(robot).falling_rate ** 2
    np.testing.assert_allclose(np.square(scale[3:] * height), 1.5 * np.square(scale[:3]))
    gains, shift = layer.law.constants.gains, Stance.of(robot).margin.min()
    assert gains.small_errors * gains.small_error <= 0.5000001 * robot.gravity * shift / height
    layer, _ = make_layer("com_wrench", robot, HZ, kind_of(robot), {"velocity_of": "com"})
    assert layer.moment_priority == 0.05 and layer.law.constants.gains.small_errors == 0.0


def test_a_priority_that_nothing_has_is_no_action():
    robot = robots.load("go1")
    for options in ({"contact_limits": "none"}, {"balancer": "ott2011"}):
        with pytest.raises(InvalidValueError, match=r"priority_action.*True"):
            layer_of("com_wrench", robot, priority_action=True, **options)


@pytest.mark.parametrize(("name", "joint"), [("g1", "hip_yaw"), ("humanoid", "ankle_roll")])
def test_feet_that_cannot_be_held_do_not_make_the_base_light(name, joint):
    """Held in directions in which its leg has no joint, a foot makes the inertia indefinite."""
    five, six = (law_of(own) for own in (without(name, joint), robots.load(name)))
    found, expected = (np.linalg.eigvalsh(law.constants.turning_inertia) for law in (five, six))
    np.testing.assert_allclose(found, expected, rtol=0.2)
