"""Walking with the feet as tasks: the body's tasks, what the feet do, and which forces carry."""

import mujoco
import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.walking_law import WalkingLaw
from fbid_gym.actions.walking_tasks import base_aim, base_task, wrench_aim
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.gait.gait import gait_of
from fbid_gym.motions.gait.target import GaitTarget
from fbid_gym.quantities import RobotState

ROBOTS = ("go1", "biped")
FRICTION = 0.6
HZ = 250


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request):
    return robots.load(request.param)


def law_of(robot, velocity_gain=0.0, **options):
    contact = ContactOptions(friction=FRICTION, compensate_damping=False, **options)
    return WalkingLaw.of(robot, HZ, gait_of(robot, HZ).omega, contact, velocity_gain)


def near_home(robot, rng, noise):
    """A robot near home, all of it in motion."""
    qpos, qvel = robot.home_qpos[None].copy(), noise * rng.normal(size=(1, robot.nv))
    qpos[:, 7:] += noise * rng.normal(size=(1, robot.num_joints))
    turn = np.array([1.0, 0.0, 0.0, 0.4]) + noise * np.array([0.0, *rng.normal(size=3)])
    qpos[:, 3:7] = turn / np.linalg.norm(turn)
    state = RobotState(qpos, qvel, np.zeros((1, robot.num_points, 3)), np.zeros(1, np.int64))
    return state, MuJoCoDynamics(robot).terms(qpos, qvel)


def target_of(robot, terms, rng, lifted=0):
    """The first foot is in the air, on its way somewhere; the body is where it shall be."""
    feet = robot.num_feet
    planted = np.ones((1, feet), bool)
    planted[0, lifted] = False
    velocity, acceleration = 0.1 * rng.normal(size=(2, 1, feet, 6))
    velocity[planted], acceleration[planted] = 0.0, 0.0
    position = terms.foot_position + 0.01 * rng.normal(size=(1, feet, 3))
    heading = np.arctan2(terms.world_from_base[:, 1, 0], terms.world_from_base[:, 0, 0])
    return GaitTarget(
        planted=planted,
        foot_position=position,
        world_from_foot=terms.world_from_foot.copy(),
        foot_velocity=velocity,
        foot_acceleration=acceleration,
        load=planted.astype(float),
        foothold=position,
        clipped=np.zeros((1, feet), bool),
        velocity=np.zeros((1, 2)),
        offset=np.zeros((1, 2)),
        com_acceleration=np.zeros((1, 2)),
        height=terms.base_position[:, 2].copy(),
        heading=heading,
        turning=np.zeros(1),
        cycle=np.zeros(1),
    )


def momentum(robot, qpos, qvel):
    """Of the whole robot about its centre of mass, and its inertia there; by MuJoCo."""
    data = mujoco.MjData(robot.model)
    data.qpos[:], data.qvel[:] = qpos, qvel
    mujoco.mj_forward(robot.model, data)
    mujoco.mj_subtreeVel(robot.model, data)
    inertia = np.zeros((3, 3))
    for body in range(1, robot.model.nbody):
        turn, r = data.ximat[body].reshape(3, 3), data.xipos[body] - data.subtree_com[1]
        inertia += turn @ np.diag(robot.model.body_inertia[body]) @ turn.T
        inertia += robot.model.body_mass[body] * (r @ r * np.eye(3) - np.outer(r, r))
    mass = robot.model.body_subtreemass[1]
    return mass * data.subtree_linvel[1], data.subtree_angmom[1].copy(), inertia


def momentum_rate(robot, state, acceleration, step=1e-5):
    """By a difference along a motion with this acceleration."""
    found = []
    for time in (step, -step):
        qpos = state.qpos[0].copy()
        way = time * state.qvel[0] + 0.5 * time**2 * acceleration
        mujoco.mj_integratePos(robot.model, qpos, way, 1.0)
        found.append(momentum(robot, qpos, state.qvel[0] + time * acceleration)[:2])
    (ahead, turn_ahead), (behind, turn_behind) = found
    return (ahead - behind) / (2 * step), (turn_ahead - turn_behind) / (2 * step)


def test_the_momentum_task_is_the_rate_of_the_momentum(robot, rng):
    state, terms = near_home(robot, rng, 0.3)
    law, target = law_of(robot), target_of(robot, terms, rng)
    task = wrench_aim(law.constants, np.zeros((1, 6)), state, target, terms).task
    acceleration = rng.normal(size=robot.nv)
    said = task.jacobian[0] @ acceleration + task.bias[0]
    force, moment = momentum_rate(robot, state, acceleration)
    *_, inertia = momentum(robot, state.qpos[0], state.qvel[0])
    # Armature on the joints is no part of the momentum.
    np.testing.assert_allclose(said[:3], force / robot.mass, atol=1e-5)
    np.testing.assert_allclose(said[3:], np.linalg.solve(inertia, moment), atol=1e-5)


def test_an_action_pushes_along_the_heading(robot, rng):
    state, terms = near_home(robot, rng, 0.1)
    law, target = law_of(robot), target_of(robot, terms, rng)
    push = rng.normal(size=6)
    tasks = [
        wrench_aim(law.constants, size * push[None], state, target, terms).task
        for size in (0.0, 1.0)
    ]
    more = tasks[1].acceleration[0] - tasks[0].acceleration[0]
    cosine, sine = np.cos(target.heading[0]), np.sin(target.heading[0])
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    *_, inertia = momentum(robot, state.qpos[0], state.qvel[0])
    np.testing.assert_allclose(more[:3], turn @ push[:3] / robot.mass)
    np.testing.assert_allclose(more[3:], np.linalg.solve(inertia, turn @ push[3:]))


def test_the_wrench_is_what_carrying_the_base_takes_while_the_feet_swing(robot, rng):
    state, _ = near_home(robot, rng, 0.3)
    state.qpos[0, 3:7] = np.cos(0.2), 0.0, 0.0, np.sin(0.2)
    state.qvel[:] = 0.0
    terms = MuJoCoDynamics(robot).terms(state.qpos, state.qvel)
    law, target = law_of(robot), target_of(robot, terms, rng)
    # Upright, at its height and at rest: no spring pulls, and no momentum is late.
    target = target._replace(foot_velocity=np.zeros((1, robot.num_feet, 6)))
    aim = wrench_aim(law.constants, np.zeros((1, 6)), state, target, terms)
    carried = aim.reference[0]
    np.testing.assert_allclose(carried[2:6], 0.0, atol=1e-3)
    for foot in range(robot.num_feet):
        gap = target.foot_position[0, foot] - terms.foot_position[0, foot]
        told = target.foot_acceleration[0, foot, :3] + law.constants.gains.swing * gap
        moved = terms.foot_jacobian[0, foot, :3] @ carried + terms.foot_bias[0, foot, :3]
        told = 0.0 if target.planted[0, foot] else told
        np.testing.assert_allclose(moved, told, atol=1e-3)
    force, moment = momentum_rate(robot, state, carried)
    *_, inertia = momentum(robot, state.qpos[0], state.qvel[0])
    wanted = aim.task.acceleration[0]
    np.testing.assert_allclose(wanted[:3], force / robot.mass, atol=1e-4)
    np.testing.assert_allclose(wanted[3:], np.linalg.solve(inertia, moment), atol=1e-4)


def test_a_moment_turns_the_base_back_and_a_force_lifts_it(robot, rng):
    state, terms = near_home(robot, rng, 0.0)
    law, target = law_of(robot), target_of(robot, terms, rng)
    constants, rise, turn = law.constants, 0.02, 0.3
    moved = target._replace(height=target.height + rise, heading=target.heading + turn)
    there, here = (
        wrench_aim(constants, np.zeros((1, 6)), state, aimed, terms).task.acceleration[0]
        for aimed in (moved, target)
    )
    *_, inertia = momentum(robot, state.qpos[0], state.qvel[0])
    heading = moved.heading[0]
    cosine, sine = np.cos(heading), np.sin(heading)
    level = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    moment = constants.gains.rotation * np.sin(turn) * level @ constants.turning_inertia[:, 2]
    np.testing.assert_allclose((there - here)[2], constants.gains.height * rise, atol=1e-9)
    np.testing.assert_allclose(inertia @ (there - here)[3:], moment, atol=1e-6)


def test_the_base_task_is_the_centre_of_mass_and_the_base(robot, rng):
    state, terms = near_home(robot, rng, 0.3)
    law = law_of(robot)
    task = base_task(law.constants, np.zeros((1, 6)), state, target_of(robot, terms, rng), terms)
    acceleration = rng.normal(size=robot.nv)
    said = task.jacobian[0] @ acceleration + task.bias[0]
    force, _ = momentum_rate(robot, state, acceleration)
    np.testing.assert_allclose(said[:2], force[:2] / robot.mass, atol=1e-5)
    np.testing.assert_allclose(said[2:], acceleration[2:6])


def test_the_base_turns_back_about_the_axis_that_it_is_tilted_about(robot, rng):
    state, terms = near_home(robot, rng, 0.0)
    axis, angle, heading = rng.normal(size=3), 0.2, 0.7
    axis /= np.linalg.norm(axis)
    upright = np.array([
        [np.cos(heading), -np.sin(heading), 0.0], [np.sin(heading), np.cos(heading), 0.0], [0, 0, 1]
    ])  # fmt: skip
    cross = np.cross(np.eye(3), axis)  # [axis]x
    tilt = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    turned = (upright @ tilt)[None]
    terms = terms._replace(world_from_base=turned, world_from_trunk=turned)
    law = law_of(robot).constants
    target = target_of(robot, terms, rng)._replace(heading=np.array([heading]))
    task = base_task(law, np.zeros((1, 6)), state, target, terms)
    np.testing.assert_allclose(
        task.acceleration[0, 3:], -law.gains.rotation * np.sin(angle) * axis, atol=1e-9
    )


def test_small_errors_of_velocity_are_answered_by_the_gain_and_greater_ones_by_no_more(rng):
    robot, gain = robots.load("go1"), 5.0
    state, terms = near_home(robot, rng, 0.1)
    omega, slow = gait_of(robot, HZ).omega, 0.03 * robot.gravity / gait_of(robot, HZ).omega
    with_gain, without = (law_of(robot, velocity_gain=size).constants for size in (gain, 0.0))
    towards = np.array([0.6, -0.8])
    for size, counts in ((0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (7.0, 1.0)):
        wanted = terms.com_velocity[:, :2] + size * slow * towards
        target = target_of(robot, terms, rng)._replace(velocity=wanted)
        for aim, name in ((base_aim, "base"), (wrench_aim, "wrench")):
            more = (
                aim(with_gain, np.zeros((1, 6)), state, target, terms).task.acceleration
                - aim(without, np.zeros((1, 6)), state, target, terms).task.acceleration
            )[0]
            expected = gain * omega * counts * slow * towards
            np.testing.assert_allclose(more[:2], expected, atol=1e-6, err_msg=name)
            if aim is base_aim:
                np.testing.assert_allclose(more[2:], 0.0, atol=1e-6)


def test_on_soles_there_is_no_such_gain():
    with pytest.raises(InvalidValueError, match="velocity_gain.*5.0.*0 on soles"):
        law_of(robots.load("biped"), velocity_gain=5.0)


def forward(robot, law, state, target, terms, torque):
    """What the torque does if the planted feet move as they are told: accelerations and forces."""
    stands = np.flatnonzero(target.planted[0])
    rows = 6 if robot.num_points > robot.num_feet else 3
    jacobian = np.concatenate([terms.foot_jacobian[0, foot, :rows] for foot in stands])
    gain = law.constants.gains.hold
    bias = np.concatenate([
        terms.foot_bias[0, foot, :rows] + gain * terms.foot_velocity[0, foot, :rows]
        for foot in stands
    ])  # fmt: skip
    size, k = robot.nv, len(bias)
    equations = np.block([
        [terms.mass_matrix[0], -jacobian.T], [jacobian, np.zeros((k, k))]
    ])  # fmt: skip
    known = np.concatenate([np.concatenate([np.zeros(6), torque]) - terms.bias[0], -bias])
    found = np.linalg.solve(equations, known)
    return found[:size], found[size:].reshape(len(stands), rows)


@pytest.mark.parametrize("limits", ["friction", "none"])
def test_feet_accelerate_as_they_are_told_and_only_those_on_the_ground_carry(robot, rng, limits):
    law = law_of(robot, contact_limits=limits)
    for _ in range(3):
        state, terms = near_home(robot, rng, 0.02)
        target = target_of(robot, terms, rng)
        aim = base_aim(law.constants, np.zeros((1, 6)), state, target, terms)
        torque = law.torque(aim, state, target, terms, law.memory(1))[0]
        acceleration, force = forward(robot, law, state, target, terms, torque)
        rows = force.shape[1]
        gains = law.constants.gains
        told = (
            target.foot_acceleration
            + gains.swing_damping * (target.foot_velocity - terms.foot_velocity)
        )[0, 0, :rows]
        told[:3] += gains.swing * (target.foot_position - terms.foot_position)[0, 0]
        foot = terms.foot_jacobian[0, 0, :rows] @ acceleration + terms.foot_bias[0, 0, :rows]
        np.testing.assert_allclose(foot, told, atol=2e-2 * max(1.0, np.abs(told).max()))
        if limits == "friction":
            slack = 1e-3 * robot.weight
            assert (force[:, 2] > -slack).all()
            most = 1.01 * FRICTION * force[:, 2] + slack
            assert (np.hypot(force[:, 0], force[:, 1]) <= most).all()
            if rows == 6:  # the centre of pressure of a sole is on it
                geometry = contact_geometry(robot)
                reach = np.abs(geometry.offset[geometry.foot_of_point == 1, :2]).max(axis=0)
                axes = terms.world_from_foot[0, 1]
                moment = axes.T @ force[0, 3:]
                normal = axes[:, 2] @ force[0, :3]
                assert abs(moment[1]) <= 1.05 * reach[0] * normal + 0.1 * robot.mass
                assert abs(moment[0]) <= 1.05 * reach[1] * normal + 0.1 * robot.mass


def test_the_torque_does_not_depend_on_the_heading(robot, rng):
    law, angle = law_of(robot), 1.1
    state, terms = near_home(robot, rng, 0.05)
    target = target_of(robot, terms, rng)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    qpos, qvel = state.qpos.copy(), state.qvel.copy()
    qpos[0, :3], qvel[0, :3] = turn @ qpos[0, :3], turn @ qvel[0, :3]
    mujoco.mju_mulQuat(
        qpos[0, 3:7],
        np.array([np.cos(angle / 2), 0, 0, np.sin(angle / 2)]),
        state.qpos[0, 3:7],
    )
    turned = state._replace(qpos=qpos, qvel=qvel)
    also = MuJoCoDynamics(robot).terms(qpos, qvel)

    def both(values):
        return np.concatenate([values[..., :3] @ turn.T, values[..., 3:] @ turn.T], axis=-1)

    aim = target._replace(
        foot_position=target.foot_position @ turn.T,
        world_from_foot=turn @ target.world_from_foot,
        foot_velocity=both(target.foot_velocity),
        foot_acceleration=both(target.foot_acceleration),
        heading=target.heading + angle,
    )
    added = rng.normal(size=(1, 6))
    torques = []
    for now, goal, known in ((state, target, terms), (turned, aim, also)):
        aim_of_body = base_aim(law.constants, added, now, goal, known)
        torques.append(law.torque(aim_of_body, now, goal, known, law.memory(1)))
    # The forces' solver stops at its accuracy, and friction cones are cut by no axes.
    np.testing.assert_allclose(*torques, atol=2e-3 * robot.torque_limit.max())
