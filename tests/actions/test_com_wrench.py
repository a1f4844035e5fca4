"""Layer com_wrench by the papers' balancers: the wrench, what becomes of it, feet that swing."""

import numpy as np
import pytest

from fbid_gym.actions import make_layer
from fbid_gym.actions.com_wrench import BALANCERS, papers_gains, turning_inertia
from fbid_gym.actions.gains import PARTS
from fbid_gym.control import (
    BalanceTarget,
    ContactLimits,
    desired_wrench_garofalo2015,
    desired_wrench_ott2011,
    distribute,
    distribute_freely,
    torque_map_garofalo2015,
    torque_map_ott2011,
)
from fbid_gym.control.balance import desired_wrench
from fbid_gym.dynamics import centroidal_terms
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.target import MotionKind
from fbid_gym.robots import ROBOTS, load
from tests.actions.cases import at_rest, home_of, layer_of, moving, torque_of
from tests.batches import begun, started, upright
from tests.pairs import pairs

TORQUE_MAPS = {"garofalo2015": torque_map_garofalo2015, "ott2011": torque_map_ott2011}
every_balancer = pytest.mark.parametrize(
    ("robot", "balancer"), pairs(ROBOTS, BALANCERS, 1), indirect=["robot"]
)


def balancing(robot, balancer="garofalo2015", **options):
    return layer_of("com_wrench", robot, balancer=balancer, **options)


def wrench_of(layer, action, state, target, terms, body):
    law = layer.law.constants
    frame = Stance.of(layer.law.robot).frame(terms)
    return desired_wrench(
        *(law.wrench, law.gravity, layer.scale * action, state, target, terms, body, frame)
    )


# --- the wrench --------------------------------------------------------------------------------


@every_balancer
def test_the_wrench_is_that_of_the_array_laws(robot, states, balancer, rng):
    """The compiled form of `desired_wrench_*`."""
    layer = balancing(robot, balancer)
    state, terms = states(6)
    body, planned = centroidal_terms(terms, state.qvel), moving(robot, terms, rng)
    action = rng.uniform(-1, 1, (6, 6))
    level = Stance.of(robot).frame(terms).world_from_support
    desired = quaternion_to_matrix(planned.qpos[:, 3:7])
    angular = np.matvec(body.matrix[:, 3:], planned.qacc)
    spin, momentum = np.matvec(desired, planned.qvel[:, 3:6]), body.matrix[:, 3:]
    moving_on = planned.com_velocity, spin, np.matvec(momentum, planned.qvel)
    rate = np.concatenate([robot.mass * planned.com_acceleration, angular], axis=1)
    target = BalanceTarget(planned.com, desired, *moving_on, rate)
    hertz = {part: layer.meant[f"{part}_frequency"] for part in PARTS}
    gains = papers_gains(robot, balancer, hertz, layer.meant["damping_ratio"])
    options = {"com": terms.com, "rotation": terms.world_from_base, "mass": body.mass}
    if balancer == "ott2011":
        spin = np.matvec(terms.world_from_base, state.qvel[:, 3:6])
        options |= {"com_velocity": terms.com_velocity, "angular_velocity": spin, "axes": level}
        expected = desired_wrench_ott2011(gains, target, **options)
    else:
        expected = desired_wrench_garofalo2015(gains, target, momentum=body.momentum, **options)
    push = layer.scale * action
    expected[:, :3] += np.matvec(level, push[:, :3])
    expected[:, 3:] += np.matvec(level, push[:, 3:])
    found = wrench_of(layer, action, state, planned, terms, body)
    np.testing.assert_allclose(found, expected, atol=1e-10 * robot.weight)


def test_the_scale_is_what_the_stance_allows(robot):
    layer = layer_of("com_wrench", robot, friction=0.5)
    support, weight = Stance.of(robot), robot.weight
    shift = support.margin / support.home_com[2]
    np.testing.assert_allclose(layer.scale[:2], weight * np.minimum(shift, 0.5))
    assert layer.scale[2] == pytest.approx(0.5 * weight)
    np.testing.assert_allclose(layer.scale[3:5], weight * support.margin[::-1])
    assert layer.scale[5] == pytest.approx(0.5 * weight * support.radius)
    assert len(layer.action_names) == 6


@every_balancer
def test_quaternions_may_have_any_length(robot, states, balancer, rng):
    layer, (_, rest) = balancing(robot, balancer), at_rest(robot)
    state, terms = states(4)
    target = moving(robot, terms, rng)
    expected = torque_of(layer, state, target, terms)
    for factor in (3.0, -0.2):
        qpos = target.qpos.copy()
        qpos[:, 3:7] *= factor
        other = torque_of(layer, state, target._replace(qpos=qpos), terms)
        np.testing.assert_allclose(other, expected, atol=1e-8 * robot.weight)
    # The inertia is between nothing and that of the locked robot.
    locked = centroidal_terms(rest, np.zeros((1, robot.nv))).inertia[0]
    inertia = turning_inertia(robot, balancer)
    np.testing.assert_allclose(inertia, inertia.T, atol=1e-12)
    assert np.linalg.eigvalsh(inertia)[0] > 0.0
    if balancer == "garofalo2015":
        np.testing.assert_allclose(inertia, locked, atol=1e-9)


@pytest.mark.parametrize(
    ("balancer", "limits"), [("garofalo2015", "none"), ("ott2011", "friction")]
)
def test_the_torque_is_the_wrench_distributed(robot, states, balancer, limits, rng):
    """The compiled tick against the functions that it stands for."""
    layer = balancing(robot, balancer, contact_limits=limits, friction=0.6)
    state, terms = states(5)
    body, target = centroidal_terms(terms, state.qvel), moving(robot, terms, rng)
    found = torque_of(layer, state, target, terms)
    gains = layer.law.constants.posture
    posture = target.qacc[:, 6:] + gains.stiffness * (target.qpos - state.qpos)[:, 7:]
    posture += gains.damping * (target.qvel - state.qvel)[:, 6:]
    contacts = reduced_contacts(contact_geometry(robot), terms)
    torque_map = TORQUE_MAPS[balancer](terms, body, contacts, posture)
    lost = robot.joint_damping * state.qvel[:, 6:]  # motors have limits for that as well
    torque_map = torque_map._replace(offset=torque_map.offset + lost)
    options = {"to_com": body.to_com, "point_map": contacts.point_map}
    options |= {"weight": robot.weight, "length": Stance.of(robot).length}
    wrench = wrench_of(layer, np.zeros((5, 6)), state, target, terms, body)
    if limits == "none":
        balance = distribute_freely(torque_map, wrench, **options)
    else:
        bounds = ContactLimits(0.6)
        balance = distribute(torque_map, wrench, bounds, torque_limit=robot.torque_limit, **options)
    np.testing.assert_allclose(found, balance.torque, atol=1e-9 * np.abs(balance.torque).max())


# --- swinging feet -----------------------------------------------------------------------------


@every_balancer
def test_feet_in_the_air_get_no_force(robot, states, balancer):
    """The torques are those of a robot without that foot's contact rows."""
    layer = balancing(robot, balancer)
    state, terms = states(4)
    home, memory = home_of(robot, terms), layer.memory(4)
    flying = home._replace(planted=np.zeros((4, robot.num_feet), bool))
    torque = layer.torque(np.zeros((4, 6)), state, flying, lambda: terms, memory)
    assert np.isfinite(torque).all()
    np.testing.assert_array_equal(memory["underactuation"], 6.0)
    assert (memory["residual"] > 0.5).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("env", "layer_options"),
    [
        ("fbid_gym/QuadrupedCrawl-v0", {"balancer": "garofalo2015"}),
        ("fbid_gym/BipedStep-v0", {"balancer": "garofalo2015"}),
        ("fbid_gym/BipedStep-v0", {"contact_ramp": 0.02}),
    ],
)
def test_zero_action_walks(env, layer_options):
    """Through a few swings of every foot, at the control rate of the task."""
    options = {"action_layer": "com_wrench", "layer_options": layer_options}
    env = begun(env, 1, episode_seconds=3.2, push_force=(0, 0), **options)
    swung = np.zeros(env.unwrapped.chunks.batches[0].simulation.robot.num_feet, bool)
    foot = contact_geometry(env.unwrapped.chunks.batches[0].simulation.robot).foot_of_point
    for _ in range(155):
        *_, terminated, _, info = env.step(np.zeros(env.action_space.shape, np.float32))
        assert not terminated.any()
        loads = info["contact_force"][0, :, 2]
        swung |= np.bincount(foot, loads, minlength=len(swung)) == 0.0
    assert swung.all()


# --- robustness --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "balancer"),
    [
        *((name, "inverse_dynamics") for name in ROBOTS),
        *(("biped", "garofalo2015"), ("biped", "ott2011"), ("humanoid", "garofalo2015")),
    ],
    indirect=["robot"],
)
def test_pushed_robots_stay_up(robot, balancer):
    """Six robots pushed from random sides with 0.15 of their weight."""
    own = {"robot": robot, "action_layer": "com_wrench", "layer_options": {"balancer": balancer}}
    own |= {"push_force": (0.15 * robot.weight,) * 2, "push_interval": (0.5, 0.8)}
    batch = started(ENVIRONMENTS["fbid_gym/BipedBalance-v0"] | own | {"episode_seconds": 2.1}, 6)
    upright(batch, 2.0)


def test_bad_options_are_refused():
    robot = load("biped")
    with pytest.raises(InvalidValueError, match="Invalid velocity_gain: 1.0. Expected 0.0, or the"):
        balancing(robot, velocity_gain=1.0)
    with pytest.raises(InvalidValueError, match="Invalid velocity_of: 'base'. Expected 'com', or"):
        balancing(robot, velocity_of="base")
    with pytest.raises(InvalidValueError, match='"inverse_dynamics" on a gait: the papers balance'):
        make_layer("com_wrench", robot, 250, MotionKind(True, 4.0), {"balancer": "ott2011"})
