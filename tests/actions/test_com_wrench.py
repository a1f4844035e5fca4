"""Layer com_wrench: the wrench it asks for, what it does with it, and feet that swing."""

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.actions import make_layer
from fbid_gym.actions.com_wrench import BALANCERS, turning_inertia
from fbid_gym.control import (
    BalanceTarget,
    ContactLimits,
    desired_wrench_garofalo2015,
    desired_wrench_ott2011,
    distribute,
    distribute_freely,
    torque_map_garofalo2015,
    torque_map_inverse_dynamics,
    torque_map_ott2011,
)
from fbid_gym.dynamics import CentroidalTerms, DynamicsTerms, MuJoCoDynamics, centroidal_terms
from fbid_gym.dynamics.contacts import contact_geometry, point_jacobian, reduced_contacts
from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.errors import InvalidValueError, UnknownOptionError
from fbid_gym.motions import home_reference
from fbid_gym.quantities import RobotState, rows_of

TORQUE_MAPS = {
    "garofalo2015": torque_map_garofalo2015,
    "ott2011": torque_map_ott2011,
    "inverse_dynamics": torque_map_inverse_dynamics,
}
every_balancer = pytest.mark.parametrize("balancer", BALANCERS)


def torque_of(layer, action, state, reference, terms):
    memory = layer.memory(len(action))
    return layer.torque(action, state, reference, lambda: terms, memory)


def at_rest(robot):
    qpos, qvel = robot.home_qpos[None].copy(), np.zeros((1, robot.nv))
    contact = np.zeros((1, robot.num_points, 3))
    contact[:, :, 2] = robot.weight / robot.num_points
    state = RobotState(qpos, qvel, contact, np.zeros(1, np.int64))
    return state, MuJoCoDynamics(robot).terms(qpos, qvel)


# --- the wrench --------------------------------------------------------------------------------


def test_the_wrench_is_the_documented_law(robot, states, moving, rng):
    """[G15] (38), (39), in the feet's frame, with the reference's momentum fed forward."""
    balance, height, ratio = 0.8, 1.3, 0.9
    options = {"balance_frequency": balance, "height_frequency": height, "damping_ratio": ratio}
    layer = make_layer("com_wrench", robot, 500, options | {"rotation_frequency": 1.1})
    state, terms = states(5)
    body, reference = centroidal_terms(terms, state.qvel), moving(5)
    action = rng.uniform(-1, 1, (5, 6))
    found = layer.wrench(action, state, reference, terms, body)
    frame = layer.stance.frame(terms)
    omega = 2.0 * np.pi * np.array([balance, balance, height])
    spin = 2.0 * np.pi * 1.1
    inertia = turning_inertia(robot, "garofalo2015")
    wanted = quaternion_to_matrix(reference.qpos[:, 3:7])
    for row in range(5):
        level = frame.world_from_support[row]
        position = level.T @ (terms.com[row] - frame.centre[row])
        velocity = level.T @ terms.com_velocity[row]
        force = reference.com_acceleration_in_support[row]
        force = force + omega**2 * (reference.com_in_support[row] - position)
        force = force + 2.0 * ratio * omega * (reference.com_velocity_in_support[row] - velocity)
        force = robot.mass * force + [0.0, 0.0, robot.weight] + layer.scale[:3] * action[row, :3]
        np.testing.assert_allclose(found[row, :3], level @ force, atol=1e-8 * robot.weight)

        rates = np.array([reference.qvel[row], reference.qacc[row]])
        rates[:, :3] = rates[:, :3] @ level.T
        angular, angular_rate = rates @ body.matrix[row, 3:].T
        desired = level @ wanted[row]
        left = desired.T @ terms.world_from_base[row]
        # quaternion of the error in the desired axes
        scalar = 0.5 * np.sqrt(1.0 + np.trace(left))
        vector = np.array(
            [left[2, 1] - left[1, 2], left[0, 2] - left[2, 0], left[1, 0] - left[0, 1]]
        ) / (4.0 * scalar)
        turned = spin**2 * inertia @ vector
        moment = desired @ (-2.0 * (scalar * turned + np.cross(vector, turned)))
        moment = moment + 2.0 * ratio * spin * (angular - body.momentum[row, 3:]) + angular_rate
        moment = moment + level @ (layer.scale[3:] * action[row, 3:])
        np.testing.assert_allclose(found[row, 3:], moment, atol=1e-8 * robot.weight)


@every_balancer
def test_the_wrench_is_that_of_the_array_laws(robot, states, moving, balancer, rng):
    """The compiled form of `desired_wrench_*` on a target seen from the robots' own feet."""
    layer = make_layer("com_wrench", robot, 500, {"balancer": balancer})
    state, terms = states(6)
    body, reference = centroidal_terms(terms, state.qvel), moving(6)
    action = rng.uniform(-1, 1, (6, 6))
    frame = layer.stance.frame(terms)
    level = frame.world_from_support
    both = np.zeros((6, robot.nv, robot.nv)) + np.eye(robot.nv)
    both[:, :3, :3] = level
    velocity, acceleration = np.matvec(both, reference.qvel), np.matvec(both, reference.qacc)
    desired = level @ quaternion_to_matrix(reference.qpos[:, 3:7])
    force = np.matvec(level, robot.mass * reference.com_acceleration_in_support)
    angular = np.matvec(body.matrix[:, 3:], acceleration)
    target = BalanceTarget(
        com=frame.centre + np.matvec(level, reference.com_in_support),
        world_from_base=desired,
        com_velocity=np.matvec(level, reference.com_velocity_in_support),
        angular_velocity=np.matvec(desired, reference.qvel[:, 3:6]),
        angular_momentum=np.matvec(body.matrix[:, 3:], velocity),
        momentum_rate=np.concatenate([force, angular], axis=1),
    )
    options = {"com": terms.com, "rotation": terms.world_from_base, "mass": body.mass}
    if balancer == "ott2011":
        expected = desired_wrench_ott2011(
            layer.gains,
            target,
            com_velocity=terms.com_velocity,
            angular_velocity=np.matvec(terms.world_from_base, state.qvel[:, 3:6]),
            axes=level,
            **options,
        )
    else:
        expected = desired_wrench_garofalo2015(
            layer.gains, target, momentum=body.momentum, **options
        )
    push = layer.scale * action
    expected[:, :3] += np.matvec(level, push[:, :3])
    expected[:, 3:] += np.matvec(level, push[:, 3:])
    found = layer.wrench(action, state, reference, terms, body)
    np.testing.assert_allclose(found, expected, atol=1e-10 * robot.weight)
    alone = layer.wrench(
        action[2:3],
        RobotState(*(value[2:3] for value in state)),
        rows_of(reference, np.array([2])),
        DynamicsTerms(*(value[2:3] for value in terms)),
        CentroidalTerms(*(value[2:3] for value in body)),
    )
    np.testing.assert_array_equal(alone[0], found[2])


@every_balancer
def test_a_robot_that_is_not_finite_spoils_no_other(robot, states, balancer):
    layer = make_layer("com_wrench", robot, 500, {"balancer": balancer})
    state, terms = states(4)
    home, action = home_reference(robot), np.zeros((4, 6))
    expected = torque_of(layer, action, state, home, terms)
    for name in ("mass_matrix", "foot_jacobian", "com"):
        broken = getattr(terms, name).copy()
        broken[1].flat[0] = np.nan
        torque = torque_of(layer, action, state, home, terms._replace(**{name: broken}))
        others = np.arange(4) != 1
        np.testing.assert_array_equal(torque[others], expected[others])
        assert np.isnan(torque[1]).any()


@every_balancer
def test_the_action_adds_to_the_wrench_along_the_feet(robot, states, balancer, rng):
    layer = make_layer("com_wrench", robot, 500, {"balancer": balancer})
    state, terms = states(4)
    body, home = centroidal_terms(terms, state.qvel), home_reference(robot)
    action = rng.uniform(-1, 1, (4, 6))
    change = layer.wrench(action, state, home, terms, body)
    change -= layer.wrench(0.0 * action, state, home, terms, body)
    level = layer.stance.frame(terms).world_from_support
    push = layer.scale * action
    expected = np.concatenate(
        [np.matvec(level, push[:, :3]), np.matvec(level, push[:, 3:])], axis=1
    )
    np.testing.assert_allclose(change, expected, atol=1e-9 * robot.weight)


def test_the_scale_is_what_the_stance_allows(robot):
    layer = make_layer("com_wrench", robot, 500, {"friction": 0.5})
    support, weight = layer.stance, robot.weight
    shift = support.margin / support.home_com[2]
    np.testing.assert_allclose(layer.scale[:2], weight * np.minimum(shift, 0.5))
    assert layer.scale[2] == pytest.approx(0.5 * weight)
    np.testing.assert_allclose(layer.scale[3:5], weight * support.margin[::-1])
    assert layer.scale[5] == pytest.approx(0.5 * weight * support.radius)
    assert len(layer.action_names) == 6


@every_balancer
def test_the_zero_action_holds_the_home_stance(robot, balancer):
    layer = make_layer("com_wrench", robot, 500, {"balancer": balancer})
    state, terms = at_rest(robot)
    torque = torque_of(layer, np.zeros((1, 6)), state, home_reference(robot), terms)[0]
    jacobian = point_jacobian(contact_geometry(robot), terms)[0][0]
    rest = terms.bias[0] - np.concatenate([np.zeros(6), torque])
    forces = np.linalg.lstsq(jacobian.T, rest, rcond=1e-9)[0]
    np.testing.assert_allclose(jacobian.T @ forces, rest, atol=2e-4 * robot.weight)


@every_balancer
def test_quaternions_of_any_length_are_the_same_reference(robot, states, moving, balancer):
    layer = make_layer("com_wrench", robot, 500, {"balancer": balancer})
    state, terms = states(4)
    reference, action = moving(4), np.zeros((4, 6))
    expected = torque_of(layer, action, state, reference, terms)
    for factor in (3.0, -0.2):
        qpos = reference.qpos.copy()
        qpos[:, 3:7] *= factor
        other = torque_of(layer, action, state, reference._replace(qpos=qpos), terms)
        np.testing.assert_allclose(other, expected, atol=1e-8 * robot.weight)


@every_balancer
def test_turning_inertia_is_between_nothing_and_the_locked_robots(robot, balancer):
    _, terms = at_rest(robot)
    locked = centroidal_terms(terms, np.zeros((1, robot.nv))).inertia[0]
    inertia = turning_inertia(robot, balancer)
    np.testing.assert_allclose(inertia, inertia.T, atol=1e-12)
    assert np.linalg.eigvalsh(inertia)[0] > 0.0
    if balancer == "garofalo2015":
        np.testing.assert_allclose(inertia, locked, atol=1e-9)


@pytest.mark.parametrize("limits", ["friction", "none"])
@every_balancer
def test_the_torque_is_the_wrench_distributed(robot, states, moving, balancer, limits):
    """The compiled tick against the functions that it stands for."""
    layer = make_layer(
        "com_wrench", robot, 500, {"balancer": balancer, "contact_limits": limits, "friction": 0.6}
    )
    state, terms = states(5)
    body, reference, action = centroidal_terms(terms, state.qvel), moving(5), np.zeros((5, 6))
    found = torque_of(layer, action, state, reference, terms)
    gains = layer.law.constants.posture
    posture = reference.qacc[:, 6:] + gains.stiffness * (reference.qpos - state.qpos)[:, 7:]
    posture += gains.damping * (reference.qvel - state.qvel)[:, 6:]
    contacts = reduced_contacts(contact_geometry(robot), terms)
    torque_map = TORQUE_MAPS[balancer](terms, body, contacts, posture)
    lost = robot.joint_damping * state.qvel[:, 6:]  # motors have limits for that as well
    torque_map = torque_map._replace(offset=torque_map.offset + lost)
    options = {
        "to_com": body.to_com,
        "point_map": contacts.point_map,
        "weight": robot.weight,
        "length": layer.stance.radius or 1.0,
    }
    wrench = layer.wrench(action, state, reference, terms, body)
    if limits == "none":
        balance = distribute_freely(torque_map, wrench, **options)
    else:
        bounds = ContactLimits(0.6)
        balance = distribute(torque_map, wrench, bounds, torque_limit=robot.torque_limit, **options)
    expected = balance.torque
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


@every_balancer
def test_a_robot_is_the_same_alone(robot, states, moving, balancer):
    layer = make_layer("com_wrench", robot, 500, {"balancer": balancer, "contacts": "measured"})
    state, terms = states(5)
    state.contact_force[1:, -1] = 0.0
    reference, action = moving(5), np.zeros((5, 6))
    together = torque_of(layer, action, state, reference, terms)
    for row in (slice(0, 1), slice(3, 4)):
        alone = torque_of(
            layer,
            action[row],
            RobotState(*(value[row] for value in state)),
            rows_of(reference, row),
            DynamicsTerms(*(value[row] for value in terms)),
        )
        np.testing.assert_array_equal(alone, together[row])


# --- swinging feet -----------------------------------------------------------------------------


def lifted(robot, reference, foot):
    planted = np.ones((len(reference.qpos), robot.num_feet), bool)
    planted[:, foot] = False
    return reference._replace(planted=planted, stepping=True)


@pytest.mark.parametrize("foot", [0, -1])
def test_a_lifted_leg_follows_its_own_command(robot, states, moving, foot):
    """Its joints accelerate as asked, with the standing feet held by their contacts."""
    options = {"balancer": "inverse_dynamics", "contact_limits": "none"}
    layer = make_layer("com_wrench", robot, 500, options)
    state, terms = states(6, noise=0.05)
    # A command that the leg can follow: larger ones would be cut off by nobody here.
    reference = lifted(robot, home_reference(robot), foot)
    torque = torque_of(layer, np.zeros((6, 6)), state, reference, terms)
    torque = torque - robot.joint_damping * state.qvel[:, 6:]
    geometry = contact_geometry(robot)
    jacobian, bias = point_jacobian(geometry, terms)
    stands = np.repeat(geometry.foot_of_point != np.arange(robot.num_feet)[foot], 3)
    jacobian, bias = jacobian[:, stands], bias[:, stands]
    legs = layer.law.constants.legs[foot]
    gains = layer.law.constants.posture
    assert legs.any() and not legs.all()
    for row in range(6):
        inverse = np.linalg.inv(terms.mass_matrix[row])
        free = np.concatenate([np.zeros(6), torque[row]]) - terms.bias[row]
        gram = jacobian[row] @ inverse @ jacobian[row].T
        force = -np.linalg.pinv(gram, rcond=1e-9) @ (bias[row] + jacobian[row] @ inverse @ free)
        acceleration = inverse @ (free + jacobian[row].T @ force)
        wanted = gains.swing_stiffness * (reference.qpos[0, 7:] - state.qpos[row, 7:])
        wanted = wanted - gains.swing_damping * state.qvel[row, 6:]
        error = (acceleration[6:] - wanted)[legs]
        assert np.abs(error).max() < 0.1 * np.abs(wanted[legs]).max()


@every_balancer
def test_feet_in_the_air_get_no_force(robot, states, balancer):
    """The torques are those of a robot without that foot's contact rows."""
    layer = make_layer("com_wrench", robot, 500, {"balancer": balancer})
    state, terms = states(4)
    home, action = home_reference(robot), np.zeros((4, 6))
    memory = layer.memory(4)
    flying = home._replace(planted=np.zeros((1, robot.num_feet), bool), stepping=True)
    torque = layer.torque(action, state, flying, lambda: terms, memory)
    assert np.isfinite(torque).all()
    np.testing.assert_array_equal(memory["underactuation"], 6.0)
    assert (memory["residual"] > 0.5).all()


@pytest.mark.parametrize(
    ("env", "layer_options"),
    [
        ("fbid_gym/QuadrupedCrawl-v0", {}),
        ("fbid_gym/BipedStep-v0", {}),
        ("fbid_gym/BipedStep-v0", {"balancer": "inverse_dynamics", "contact_ramp": 0.02}),
    ],
)
def test_zero_action_walks(env, layer_options):
    """Through a few swings of every foot, at the control rate of the task."""
    options = {"action_layer": "com_wrench", "layer_options": layer_options}
    env = gym.make_vec(env, num_envs=1, episode_seconds=3.2, push_force=(0, 0), **options)
    env.reset(seed=0)
    swung = np.zeros(env.unwrapped.chunks.batches[0].simulation.robot.num_feet, bool)
    foot = contact_geometry(env.unwrapped.chunks.batches[0].simulation.robot).foot_of_point
    for _ in range(155):
        *_, terminated, _, info = env.step(np.zeros(env.action_space.shape, np.float32))
        assert not terminated.any()
        loads = info["contact_force"][0, :, 2]
        swung |= np.bincount(foot, loads, minlength=len(swung)) == 0.0
    assert swung.all()


# --- robustness --------------------------------------------------------------------------------


def test_pushed_robots_stay_up(robot):
    """Six robots pushed from random sides with 0.15 of their weight."""
    env = gym.make_vec(
        "fbid_gym/BipedBalance-v0",
        robot=robot.name,
        num_envs=6,
        action_layer="com_wrench",
        push_force=(0.15 * robot.weight, 0.15 * robot.weight),
        push_interval=(0.5, 0.8),
        episode_seconds=2.1,
    )
    env.reset(seed=0)
    for _ in range(100):
        *_, terminated, _, _ = env.step(np.zeros(env.action_space.shape, np.float32))
        assert not terminated.any()


def test_bad_options_are_refused(robot):
    with pytest.raises(UnknownOptionError, match="Unknown balancer 'toro'. Valid choices: garo"):
        make_layer("com_wrench", robot, 500, {"balancer": "toro"})
    for name in (
        "balance_frequency",
        "height_frequency",
        "rotation_frequency",
        "posture_frequency",
        "swing_frequency",
        "damping_ratio",
        "moment_priority",
    ):
        for value in (0.0, -1.0, np.nan, "fast", True):
            with pytest.raises(InvalidValueError, match=f"Invalid {name}: "):
                make_layer("com_wrench", robot, 500, {name: value})
