"""Joint motions on a gait: the feet get to where the gait wants them."""

import mujoco
import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.actions.gains import default_gains
from fbid_gym.actions.joint_motion import JointMotion
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions.target import MotionKind, standing_target
from tests.actions.cases import state_at
from tests.postures import posed


@pytest.fixture(scope="module", params=["go1", "biped"])
def robot(request):
    return robots.load(request.param)


def motion_of(robot, aware):
    """The joint motion, of a body that is not balanced beside its target."""
    kind = MotionKind(True, Stance.of(robot).falling_rate)
    gains = default_gains(robot, kind)._replace(balance=0.0, balance_damping=0.0)
    return JointMotion.of(robot, kind, gains, aware=aware)


def target_of(robot, terms, rng):
    """Feet and body on their way somewhere, the base lower than it is."""
    feet, target = robot.num_feet, standing_target(terms, robot.home_qpos)
    target.foot_position[:] += 0.03 * robot.home_qpos[2] * rng.uniform(-1, 1, size=(1, feet, 3))
    target.foot_velocity[:] = 0.2 * rng.normal(size=(1, feet, 6))
    target.com_velocity[:, :2] = 0.2 * rng.normal(size=(1, 2))
    target.com[:, :2] += 0.01 * rng.normal(size=(1, 2))
    target.qpos[:, 2] -= 0.1 * robot.home_qpos[2]
    target.qvel[:, 5] = 0.3 * rng.normal(size=1)
    return target


def foot_places(robot, qpos):
    """By MuJoCo's forward kinematics."""
    data = posed(robot, qpos)
    return np.array([data.xpos[foot.body] for foot in robot.feet])


def assert_feet_move(motion, velocity, target, terms):
    """As the target says."""
    found = terms.foot_jacobian[0] @ velocity
    rows = np.s_[:, : motion.legs.rows]
    np.testing.assert_allclose(found[rows], target.foot_velocity[0][rows], atol=2e-2)


def test_the_reference_reaches_the_feet_and_moves_with_them(robot, rng):
    motion = motion_of(robot, aware=False)
    qpos = robot.home_qpos[None].copy()
    state, terms = state_at(robot, qpos, carried=0.0)
    before = foot_places(robot, qpos[0])
    body_at_home = terms.foot_position[0] - before
    target = target_of(robot, terms, rng)
    # The body comes to where the gait wants it, and the joints follow their reference.
    qpos = qpos.copy()
    qpos[:, 2] = target.qpos[:, 2]
    qpos[:, :2] += (target.com - terms.com)[:, :2]
    gaps = []
    qvel = np.zeros((1, robot.nv))
    qvel[:, :2] = target.com_velocity[:, :2]  # it is there, as fast as it shall be
    for _ in range(12):
        state, terms = state_at(robot, qpos, qvel, carried=0.0)
        gaps.append(np.abs(target.foot_position - terms.foot_position).max())
        target.com[:] = terms.com
        found = motion.target(state, target, terms)
        qpos = np.concatenate([qpos[:, :7], found.qpos[:, 7:]], axis=1)
    # Newton's steps converge.
    assert gaps[-1] < 1e-5 < 1e-3 < gaps[0]
    if robot.num_points > robot.num_feet:  # soles keep level, and so their bodies' offset
        places = foot_places(robot, qpos[0])
        np.testing.assert_allclose(places + body_at_home, target.foot_position[0], atol=1e-4)
    velocity = np.zeros(robot.nv)
    velocity[:2] = target.com_velocity[0, :2]
    velocity[3:6] = terms.world_from_base[0, 2] * target.qvel[0, 5]
    velocity[6:] = found.qvel[0, 6:]
    assert_feet_move(motion, velocity, target, terms)
    low, high = robot.joint_range.T
    assert ((found.qpos[0, 7:] >= low) & (found.qpos[0, 7:] <= high)).all()


@pytest.mark.parametrize("aware", [False, True])
def test_accelerations_are_the_rate_of_the_rates_along_a_swing(robot, rng, aware):
    """Body and feet move as the gait wants them, and the joints with them, for a moment."""
    motion, tick = motion_of(robot, aware), 1e-5
    qpos = robot.home_qpos[None].copy()
    qpos[:, 7:] += 0.05 * rng.normal(size=(1, robot.num_joints))
    state, terms = state_at(robot, qpos, carried=0.0)
    now = target_of(robot, terms, rng)
    now.planted[:], now.qvel[:] = False, 0.0
    now.foot_acceleration[:] = 2.0 * rng.normal(size=now.foot_acceleration.shape)
    now.com_acceleration[:] = rng.normal(size=(1, 3)) * [1.0, 1.0, 0.0]
    # The gait's own motion, and a tick later.
    qvel = np.zeros((1, robot.nv))
    qvel[:, :2] = now.com_velocity[:, :2]
    state, terms = state_at(robot, qpos, qvel, carried=0.0)
    qvel[:, 6:] = motion.target(state, now, terms).qvel[:, 6:]
    state, terms = state_at(robot, qpos, qvel, carried=0.0)
    found = motion.target(state, now, terms)
    later = now._replace(
        foot_velocity=now.foot_velocity + tick * now.foot_acceleration,
        com_velocity=now.com_velocity + tick * now.com_acceleration,
    )
    qpos = qpos.copy()
    mujoco.mj_integratePos(robot.model, qpos[0], qvel[0], tick)
    qvel = qvel.copy()
    qvel[:, :2] = later.com_velocity[:, :2]
    state, terms = state_at(robot, qpos, qvel, carried=0.0)
    after = motion.target(state, later, terms)
    rate = (after.qvel - found.qvel)[0, 6:] / tick
    # But for what is damped: at home a biped's knees are almost stretched.
    np.testing.assert_allclose(found.qacc[0, 6:], rate, atol=2e-2 * np.abs(rate).max())


def test_a_foot_in_the_air_is_led_from_the_body_as_it_moves_by_those_who_know(robot, rng):
    """Whatever the body does, J v is what the foot shall do; a Newton step closes its gap."""
    motion = motion_of(robot, aware=True)
    qpos, qvel = robot.home_qpos[None].copy(), 0.2 * rng.normal(size=(1, robot.nv))
    qpos[:, 7:] += 0.05 * rng.normal(size=(1, robot.num_joints))
    state, terms = state_at(robot, qpos, qvel, carried=0.0)
    target = target_of(robot, terms, rng)._replace(planted=np.zeros((1, robot.num_feet), bool))
    found = motion.target(state, target, terms)
    velocity = np.concatenate([qvel[0, :6], found.qvel[0, 6:]])
    assert_feet_move(motion, velocity, target, terms)
    gaps = [np.abs(target.foot_position - terms.foot_position).max()]
    for _ in range(8):
        qpos = np.concatenate([qpos[:, :7], found.qpos[:, 7:]], axis=1)
        state, terms = state_at(robot, qpos, qvel, carried=0.0)
        found = motion.target(state, target, terms)
        gaps.append(np.abs(target.foot_position - terms.foot_position).max())
    assert gaps[-1] < 1e-5 < 1e-3 < gaps[0]


def lagging(robot, speed):
    """A body that is where it shall be, but lacks a speed (2,) m/s."""
    qvel = np.zeros((1, robot.nv))
    qvel[0, :2] = -np.asarray(speed)
    state, terms = state_at(robot, robot.home_qpos[None].copy(), qvel, carried=0.0)
    return standing_target(terms, robot.home_qpos), state, terms


def test_feet_that_stand_lead_the_body_by_its_error_of_velocity_but_not_far():
    robot = robots.load("go1")
    motion, direction = motion_of(robot, aware=False), np.array([0.6, -0.8])
    legs = motion.legs
    pendulum_time = 1.0 / Stance.of(robot).falling_rate
    moved = []
    for size, load in ((0.5, 1.0), (1.0, 1.0), (100.0, 1.0), (1.0, 0.25)):
        speed = size * legs.farthest / legs.lead * direction
        target, state, terms = lagging(robot, speed)
        target = target._replace(load=np.full((1, 4), load))
        found = motion.target(state, target, terms)
        # The joints move the feet as far back below the body as that shall move ahead.
        joints = (found.qpos - state.qpos)[0, 7:]
        foot = terms.foot_jacobian[0, :, :3, 6:] @ joints
        moved.append(-foot)
    np.testing.assert_allclose(legs.lead, 2.0 * pendulum_time)
    most = np.append(legs.farthest * direction, 0.0)
    for share, found in zip((0.5, 1.0, 1.0, 0.25), moved, strict=True):
        np.testing.assert_allclose(found, np.tile(share * most, (4, 1)), atol=1e-2 * legs.farthest)


@pytest.mark.parametrize(
    ("name", "aware", "load"),
    [("go1", False, 0.0), ("go1", True, 1.0), ("biped", False, 1.0), ("biped", True, 1.0)],
)
def test_nothing_else_is_led(name, aware, load):
    """Neither feet without load, nor for layers that know the dynamics, nor on soles."""
    robot = robots.load(name)
    motion, found = motion_of(robot, aware), []
    for speed in ((0.0, 0.0), (0.3, -0.2)):
        target, state, terms = lagging(robot, speed)
        target = target._replace(load=np.full((1, robot.num_feet), load))
        found.append(motion.target(state, target, terms).qpos[0, 7:])
    np.testing.assert_allclose(found[1], found[0], atol=1e-12)
