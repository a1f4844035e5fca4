"""Joint motions of a gait: the feet get to where the gait wants them."""

import mujoco
import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions.gait.joints import joint_reference, leg_joints_of
from fbid_gym.motions.gait.target import GaitTarget
from fbid_gym.quantities import RobotState


@pytest.fixture(scope="module", params=["go1", "biped"])
def robot(request):
    return robots.load(request.param)


def state_of(robot, qpos, qvel=None):
    qvel = np.zeros((1, robot.nv)) if qvel is None else qvel
    rest = np.zeros((1, robot.num_points, 3)), np.zeros(1, np.int64)
    return RobotState(qpos, qvel, *rest), MuJoCoDynamics(robot).terms(qpos, qvel)


def target_of(robot, terms, rng):
    feet = robot.num_feet
    shift = 0.03 * robot.home_qpos[2] * rng.uniform(-1, 1, size=(1, feet, 3))
    return GaitTarget(
        planted=np.ones((1, feet), bool),
        foot_position=terms.foot_position + shift,
        world_from_foot=terms.world_from_foot.copy(),
        foot_velocity=0.2 * rng.normal(size=(1, feet, 6)),
        foot_acceleration=np.zeros((1, feet, 6)),
        load=np.ones((1, feet)),
        foothold=terms.foot_position.copy(),
        clipped=np.zeros((1, feet), bool),
        velocity=0.2 * rng.normal(size=(1, 2)),
        offset=0.01 * rng.normal(size=(1, 2)),
        com_acceleration=np.zeros((1, 2)),
        height=terms.base_position[:, 2] - 0.1 * robot.home_qpos[2],
        heading=np.arctan2(terms.world_from_base[:, 1, 0], terms.world_from_base[:, 0, 0]),
        turning=0.3 * rng.normal(size=1),
        cycle=np.zeros(1),
    )


def foot_places(robot, qpos):
    """By MuJoCo's forward kinematics."""
    data = mujoco.MjData(robot.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(robot.model, data)
    return data, np.array([data.xpos[foot.body] for foot in robot.feet])


def test_the_reference_reaches_the_feet_and_moves_with_them(robot, rng):
    legs = leg_joints_of(robot, aware=False)
    qpos = robot.home_qpos[None].copy()
    state, terms = state_of(robot, qpos)
    _, before = foot_places(robot, qpos[0])
    body_at_home = terms.foot_position[0] - before
    target = target_of(robot, terms, rng)
    # The body comes to where the gait wants it, and the joints follow their reference.
    qpos = qpos.copy()
    qpos[:, 2] += target.height - terms.base_position[:, 2]
    qpos[:, :2] += target.offset
    gaps = []
    target = target._replace(offset=np.zeros((1, 2)))  # it is there, as fast as it shall be
    qvel = np.zeros((1, robot.nv))
    qvel[:, :2] = target.velocity
    for _ in range(12):
        state, terms = state_of(robot, qpos, qvel)
        gaps.append(np.abs(target.foot_position - terms.foot_position).max())
        found = joint_reference(legs, target, state, terms)
        qpos = np.concatenate([qpos[:, :7], found.qpos[:, 7:]], axis=1)
    # Newton's steps converge.
    assert gaps[-1] < 1e-5 < 1e-3 < gaps[0]
    if robot.num_points > robot.num_feet:  # soles keep level, and so their bodies' offset
        _, places = foot_places(robot, qpos[0])
        np.testing.assert_allclose(places + body_at_home, target.foot_position[0], atol=1e-4)
    velocity = np.zeros(robot.nv)
    velocity[:2] = target.velocity[0]
    velocity[3:6] = terms.world_from_base[0, 2] * target.turning[0]
    velocity[6:] = found.qvel[0, 6:]
    rows = legs.rows
    np.testing.assert_allclose(
        terms.foot_jacobian[0, :, :rows] @ velocity, target.foot_velocity[0, :, :rows], atol=2e-2
    )
    low, high = robot.joint_range.T
    assert ((found.qpos[0, 7:] >= low) & (found.qpos[0, 7:] <= high)).all()


@pytest.mark.parametrize("aware", [False, True])
def test_accelerations_are_the_rate_of_the_rates_along_a_swing(robot, rng, aware):
    """Body and feet move as the gait wants them, and the joints with them, for a moment."""
    legs, tick = leg_joints_of(robot, aware), 1e-5
    qpos = robot.home_qpos[None].copy()
    qpos[:, 7:] += 0.05 * rng.normal(size=(1, robot.num_joints))
    state, terms = state_of(robot, qpos)
    now = target_of(robot, terms, rng)._replace(
        planted=np.zeros((1, robot.num_feet), bool),
        foot_acceleration=2.0 * rng.normal(size=(1, robot.num_feet, 6)),
        com_acceleration=rng.normal(size=(1, 2)),
        turning=np.zeros(1),
    )
    # The gait's own motion, and a tick later.
    qvel = np.zeros((1, robot.nv))
    qvel[:, :2] = now.velocity
    state, terms = state_of(robot, qpos, qvel)
    qvel[:, 6:] = joint_reference(legs, now, state, terms).qvel[:, 6:]
    found = joint_reference(legs, now, *state_of(robot, qpos, qvel))
    later = now._replace(
        foot_velocity=now.foot_velocity + tick * now.foot_acceleration,
        velocity=now.velocity + tick * now.com_acceleration,
    )
    qpos = qpos.copy()
    mujoco.mj_integratePos(robot.model, qpos[0], qvel[0], tick)
    qvel = qvel.copy()
    qvel[:, :2] = later.velocity
    after = joint_reference(legs, later, *state_of(robot, qpos, qvel))
    rate = (after.qvel - found.qvel)[0, 6:] / tick
    # But for what is damped: at home a biped's knees are almost stretched.
    np.testing.assert_allclose(found.qacc[0, 6:], rate, atol=2e-2 * np.abs(rate).max())


def test_a_foot_in_the_air_is_led_from_the_body_as_it_moves_by_those_who_know(robot, rng):
    """Whatever the body does, J v is what the foot shall do; a Newton step closes its gap."""
    legs = leg_joints_of(robot, aware=True)
    qpos, qvel = robot.home_qpos[None].copy(), 0.2 * rng.normal(size=(1, robot.nv))
    qpos[:, 7:] += 0.05 * rng.normal(size=(1, robot.num_joints))
    state, terms = state_of(robot, qpos, qvel)
    target = target_of(robot, terms, rng)._replace(planted=np.zeros((1, robot.num_feet), bool))
    found = joint_reference(legs, target, state, terms)
    velocity = np.concatenate([qvel[0, :6], found.qvel[0, 6:]])
    np.testing.assert_allclose(
        terms.foot_jacobian[0, :, : legs.rows] @ velocity,
        target.foot_velocity[0, :, : legs.rows],
        atol=2e-2,
    )
    gaps = [np.abs(target.foot_position - terms.foot_position).max()]
    for _ in range(8):
        qpos = np.concatenate([qpos[:, :7], found.qpos[:, 7:]], axis=1)
        state, terms = state_of(robot, qpos, qvel)
        found = joint_reference(legs, target, state, terms)
        gaps.append(np.abs(target.foot_position - terms.foot_position).max())
    assert gaps[-1] < 1e-5 < 1e-3 < gaps[0]


def lagging(robot, speed):
    """A body that is where it shall be, but lacks a speed (2,) m/s."""
    qvel = np.zeros((1, robot.nv))
    qvel[0, :2] = -np.asarray(speed)
    state, terms = state_of(robot, robot.home_qpos[None].copy(), qvel)
    target = target_of(robot, terms, np.random.default_rng(0))._replace(
        foot_velocity=np.zeros((1, robot.num_feet, 6)),
        velocity=np.zeros((1, 2)),
        foot_position=terms.foot_position.copy(),
        offset=np.zeros((1, 2)),
        height=terms.base_position[:, 2],
        turning=np.zeros(1),
    )
    return target, state, terms


def test_feet_that_stand_lead_the_body_by_its_error_of_velocity_but_not_far():
    robot = robots.load("go1")
    legs, direction = leg_joints_of(robot, aware=False), np.array([0.6, -0.8])
    pendulum_time = 1.0 / Stance.of(robot).falling_rate
    moved = []
    for size, load in ((0.5, 1.0), (1.0, 1.0), (100.0, 1.0), (1.0, 0.25)):
        speed = size * legs.farthest / legs.lead * direction
        target, state, terms = lagging(robot, speed)
        target = target._replace(load=np.full((1, 4), load))
        found = joint_reference(legs, target, state, terms)
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
    legs, found = leg_joints_of(robot, aware), []
    for speed in ((0.0, 0.0), (0.3, -0.2)):
        target, state, terms = lagging(robot, speed)
        target = target._replace(load=np.full((1, robot.num_feet), load))
        found.append(joint_reference(legs, target, state, terms).qpos[0, 7:])
    np.testing.assert_allclose(found[1], found[0], atol=1e-12)
