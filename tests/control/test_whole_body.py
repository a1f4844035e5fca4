"""The law, leg by leg, against dense laws and forward dynamics."""

from dataclasses import replace
from itertools import combinations
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pytest
from scipy.optimize import nnls

from fbid_gym import robots
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.gains import default_gains
from fbid_gym.actions.law import BodyLaw
from fbid_gym.control import (
    ContactLimits,
    limited_inverse_dynamics,
    operational_space_acceleration,
    orthogonal_inverse_dynamics,
)
from fbid_gym.control.body_law import Command, desired_acceleration
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import reduced_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions.target import planned_kind, standing_target
from fbid_gym.quantities import DynamicsTerms, RobotState, Target, some_of
from fbid_gym.robots import Robot, zoo
from fbid_gym.robots.built_in import QUADRUPED
from fbid_gym.robots.drives import TorqueLine
from tests import postures
from tests.pairs import pairs
from tests.postures import bent

FRICTION, HZ = 0.6, 500
SPARE = ("biped",)  # legs of seven joints: see `whole_body`, they move by themselves for no task


class Scene(NamedTuple):
    """Robots on some of their feet, and what they shall do."""

    robot: Robot
    state: RobotState
    terms: DynamicsTerms
    target: Target
    command: Command


def law_of(robot: Robot, moment_priority: float = 1.0, **options: Any) -> BodyLaw:
    plain = {"friction": FRICTION, "compensate_damping": False, "notice_slip": False}
    contact = ContactOptions(**plain | options).on(robot, kind := planned_kind(robot))
    gains = default_gains(robot, kind)
    # Scenes ask for more than motors give; those are the matter of `test_motor_limits`.
    return boundless(BodyLaw.of(robot, HZ, contact, gains, moment_priority))


def boundless(law: BodyLaw) -> BodyLaw:
    """The law with motors that give every torque."""
    line = law.constants.motors.line
    return with_line(law, line._replace(torque=np.full(law.robot.num_joints, 1e9)))


def with_line(law: BodyLaw, line: TorqueLine) -> BodyLaw:
    """The law with motors of another torque-speed line."""
    motors = law.constants.motors._replace(line=line)
    return replace(law, constants=law.constants._replace(motors=motors))


def planted_sets(robot: Robot) -> np.ndarray:
    """(K, F) bool, every set of feet on the ground: none, one, pairs, ... all."""
    feet = range(robot.num_feet)
    sets = [chosen for size in range(len(feet) + 1) for chosen in combinations(feet, size)]
    return np.array([[foot in chosen for foot in feet] for chosen in sets])


def standing(robot: Robot, qpos: np.ndarray, qvel: np.ndarray, *asked: np.ndarray) -> Scene:
    """Robots in a state, on all feet; accelerations asked of all coordinates and of the body."""
    count, terms = len(qpos), MuJoCoDynamics(robot).terms(qpos, qvel)
    force, tick = np.zeros((count, robot.num_points, 3)), np.zeros(count, np.int64)
    state, target = RobotState(qpos, qvel, force, tick), standing_target(terms, robot.home_qpos)
    return Scene(robot, state, terms, target, Command(*asked, np.empty((0, 6))))


def scene_of(robot: Robot, rng: np.random.Generator, size: float = 3.0, each: int = 2) -> Scene:
    """Robots on bent legs that move and are turned, on every set of feet.

    Args:
        robot: the robot.
        rng: of chance.
        size: m/s^2 and rad/s^2 that are asked for.
        each: how many on each set of feet.
    """
    planted = np.repeat(planted_sets(robot), each, axis=0)
    count = len(planted)
    qpos = np.repeat(bent(robot)[None], count, axis=0)
    noise = 0.1 * min(size, 1.0)
    qpos[:, 7:] += noise * rng.normal(size=(count, robot.num_joints))
    qpos[:, :3] += rng.normal(size=(count, 3))
    for row, turn in zip(qpos, rng.normal(size=(count, 4)) * [0.0, noise, noise, 0.5], strict=True):
        mujoco.mju_mulQuat(row[3:7], turn + [1.0, 0.0, 0.0, 0.0], row[3:7].copy())
        row[3:7] /= np.linalg.norm(row[3:7])
    qvel = 0.1 * min(size, 3.0) * rng.normal(size=(count, robot.nv))
    scene = standing(robot, qpos, qvel, np.empty((count, robot.nv)), np.empty((count, 6)))
    target = scene.target
    target.planted[:], target.load[:] = planted, planted
    target.foot_position[:] += 0.02 * rng.normal(size=target.foot_position.shape)
    target.foot_velocity[:] = 0.1 * size * rng.normal(size=target.foot_velocity.shape)
    target.foot_acceleration[:] = size * rng.normal(size=target.foot_acceleration.shape)
    for asked in scene.command[:2]:
        asked[:] = size * rng.normal(size=asked.shape)
    return scene


def desired_of(law: BodyLaw, scene: Scene) -> np.ndarray:
    active = law.belief(scene.state, scene.target)
    return desired_acceleration(
        law.constants, scene.command, scene.state, scene.target, scene.terms, active
    )


def torque_of(law: BodyLaw, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Torques, and the residuals that come with them."""
    memory = law.memory(len(scene.state.qpos))
    given = scene.command, scene.state, scene.target, scene.terms
    return law.torque(*given, memory), memory["residual"]


def asked_of_feet(law: BodyLaw, scene: Scene) -> np.ndarray:
    """(N, F, 6) acceleration of the feet: springs to their target, or nothing but to stay."""
    gains, target, terms = law.constants.gains, scene.target, scene.terms
    left = terms.world_from_foot.mT @ target.world_from_foot
    skewed = 0.5 * (left - left.mT)
    sine = np.stack([skewed[..., 2, 1], skewed[..., 0, 2], skewed[..., 1, 0]], axis=-1)
    turn = np.matvec(terms.world_from_foot, sine)
    gap = np.concatenate([target.foot_position - terms.foot_position, turn], -1)
    late = target.foot_velocity - terms.foot_velocity
    swing = target.foot_acceleration + gains.swing * gap + gains.swing_damping * late
    stand = -gains.hold * terms.foot_velocity
    return np.where(target.planted[..., None], stand, swing)


def rows_of(scene: Scene, law: BodyLaw) -> tuple[np.ndarray, np.ndarray]:
    """Rows (N, k, nv) of all feet, and Jdot v less what is asked of them (N, k)."""
    size = 6 if scene.robot.has_soles else 3
    jacobian = scene.terms.foot_jacobian[:, :, :size]
    bias = (scene.terms.foot_bias - asked_of_feet(law, scene))[:, :, :size]
    count = len(jacobian)
    return jacobian.reshape(count, -1, scene.robot.nv), bias.reshape(count, -1)


def body_rows(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Rows (N, 6, nv) of centre of mass in x and y, height and rotation of the base; Jdot v."""
    robot, terms = scene.robot, scene.terms
    rows = np.tile(np.eye(6, robot.nv), (len(terms.bias), 1, 1))
    rows[:, :2] = terms.mass_matrix[:, :2] / robot.mass
    bias = np.zeros((len(rows), 6))
    bias[:, :2] = terms.bias[:, :2] / robot.mass
    return rows, bias


# --- the motion --------------------------------------------------------------------------------


def test_feet_go_first_and_the_motion_is_that_of_the_dense_law(robot, rng):
    """Feet as contacts, the body as a task, the same reference and metric: [M10] eq. (19)."""
    scene, law = scene_of(robot, rng), law_of(robot)
    (jacobian, bias), (rows, rate) = rows_of(scene, law), body_rows(scene)
    found, planted = desired_of(law, scene), scene.target.planted
    # Feet that stand stay, those in the air go where they shall; but for the ridges on G.
    missed = np.abs(np.matvec(jacobian, found) + bias).reshape(*planted.shape, -1).max(axis=-1)
    size = np.abs(asked_of_feet(law, scene)).max()
    assert missed[planted].max() < 1e-6 * size and missed[~planted].max() < 1e-4 * size
    metric = 1.0 / law.constants.mobility
    dense = operational_space_acceleration(
        *(jacobian, bias, rows, rate, scene.command.body, scene.command.reference),
        motion_cost=metric,
        least_gain=1e-6,
    )
    np.testing.assert_allclose(np.matvec(rows, found) + rate, scene.command.body, atol=1e-6)
    if robot.name not in SPARE:
        size = np.abs(dense.motion).max(axis=1, keepdims=True)
        np.testing.assert_allclose(found / size, dense.motion / size, atol=1e-4)
    else:  # near it: no more motion than a tenth beside the least
        away = (a - scene.command.reference for a in (dense.motion, found))
        least, own = (np.vecdot(metric * gap, gap) for gap in away)
        assert (least <= own * (1.0 + 1e-6)).all() and (own < 1.1 * least).all()


# --- forces and torques ------------------------------------------------------------------------


def move(scene: Scene, law: BodyLaw, torque: np.ndarray, i: int) -> tuple[np.ndarray, np.ndarray]:
    """What a torque does while standing feet move as they are told: acceleration, foot wrenches."""
    size = 6 if scene.robot.has_soles else 3
    stands = np.repeat(scene.target.planted[i], size)
    jacobian, bias = (part[i][stands] for part in rows_of(scene, law))
    inverse = np.linalg.inv(scene.terms.mass_matrix[i])
    free = inverse @ (np.concatenate([np.zeros(6), torque[i]]) - scene.terms.bias[i])
    force = -np.linalg.pinv(jacobian @ inverse @ jacobian.T, rcond=1e-12) @ (bias + jacobian @ free)
    return free + inverse @ jacobian.T @ force, force.reshape(-1, size)


def beyond_cones(scene: Scene, law: BodyLaw, wrench: np.ndarray, i: int) -> float:
    """How far, in N and N·m, foot wrenches (K, 3 or 6) are from what points in cones can do."""
    geometry, worst = law.constants.geometry, 0.0
    angles = np.arange(64) * 2.0 * np.pi / 64
    edges = np.stack([FRICTION * np.cos(angles), FRICTION * np.sin(angles), np.ones(64)])
    for found, foot in zip(wrench, np.flatnonzero(scene.target.planted[i]), strict=True):
        own = geometry.offset[geometry.foot_of_point == foot]
        arms = own @ scene.terms.world_from_foot[i, foot].T
        pushes = [np.concatenate([edges, np.cross(arm, edges.T).T])[: len(found)] for arm in arms]
        # Least squares with forces along the edges alone; the polygon is within the cone.
        worst = max(worst, nnls(np.concatenate(pushes, axis=1), found)[1])
    return worst


@pytest.mark.parametrize("size", [0.2, 8.0])
def test_torques_do_what_is_promised_by_forces_within_their_cones(robot, rng, size):
    """By forward dynamics with hard contacts; with all that is asked where no limit binds."""
    scene, law = scene_of(robot, rng, size), law_of(robot)
    torque, residual = torque_of(law, scene)
    desired, free = desired_of(law, scene), 0
    for i in range(len(torque)):
        acceleration, wrench = move(scene, law, torque, i)
        push = robot.weight * (1.0 + np.abs(desired[i]).max() / robot.gravity)
        # The inscribed polygon of 64 edges is 0.12 % smaller than the cone.
        assert beyond_cones(scene, law, wrench, i) < 2e-3 * push
        if residual[i] < 1e-5:
            free += 1
            most = np.abs(desired[i]).max()
            np.testing.assert_allclose(acceleration, desired[i], atol=1e-4 * most)
    assert free > 0 or size > 1.0


def test_torques_are_those_of_the_dense_law(robot, rng):
    """With feet in the air as contacts that bear no force."""
    if robot.name in SPARE:
        pytest.skip("its legs have joints to spare")
    scene, law = scene_of(robot, rng, 2.0), law_of(robot)
    torque, residual = torque_of(law, scene)
    desired, constants = desired_of(law, scene), law.constants
    active = law.belief(scene.state, scene.target)
    contacts = reduced_contacts(constants.geometry, scene.terms)
    point_map = contacts.point_map * np.repeat(active, 3, axis=1)[:, None]
    friction, least, most = constants.limits[0].T
    dense = limited_inverse_dynamics(
        *(scene.terms.mass_matrix, scene.terms.bias, contacts.jacobian, desired),
        -np.matvec(contacts.jacobian, desired),
        ContactLimits(friction, least, np.minimum(most, constants.most_load * robot.weight)),
        point_map=point_map,
        active=active,
        base_priority=1.0 / constants.mobility[:6],
        length=Stance.of(robot).length,
    )
    np.testing.assert_allclose(residual, dense.residual, atol=1e-3)
    np.testing.assert_allclose(torque, dense.torque, atol=2e-3 * np.abs(dense.torque).max())


def test_without_limits_the_torque_is_equation_15(robot, rng):
    scene, law = scene_of(robot, rng), law_of(robot, contact_limits="none")
    desired, active = desired_of(law, scene), law.belief(scene.state, scene.target)
    contacts = reduced_contacts(law.constants.geometry, scene.terms, active)
    expected = orthogonal_inverse_dynamics(
        *(scene.terms.mass_matrix, scene.terms.bias, contacts.jacobian, desired),
        -np.matvec(contacts.jacobian, desired),
        base_priority=1.0 / law.constants.mobility[:6],
    )
    torque, _ = torque_of(law, scene)
    size = np.abs(expected.torque).max()
    np.testing.assert_allclose(torque, expected.torque, atol=1e-7 * size)
    # Where the contacts can push the base in every direction it is all that is asked for.
    for i in np.flatnonzero(expected.underactuation == 0):
        acceleration, _ = move(scene, law, torque, i)
        most = np.abs(desired[i]).max()
        np.testing.assert_allclose(acceleration, desired[i], atol=1e-5 * most)


def test_on_two_points_moments_are_traded_for_forces():
    """About the line of two diagonal feet: the more a moment counts, the less of it is missed."""
    robot = robots.load("go1")
    scene = scene_of(robot, np.random.default_rng(5), 1.0)
    pairs = some_of_scene(scene, np.flatnonzero(scene.target.planted.sum(axis=1) == 2))
    missed = []
    for priority in (0.01, 0.1, 1.0, 10.0, 100.0):
        law = law_of(robot, priority)
        torque, _ = torque_of(law, pairs)
        desired = desired_of(law, pairs)
        late = np.array([move(pairs, law, torque, i)[0] for i in range(len(torque))]) - desired
        wrench = np.matvec(pairs.terms.mass_matrix[:, :6], late)
        missed.append([np.linalg.norm(part, axis=1) for part in np.split(wrench, 2, axis=1)])
    force, moment = np.moveaxis(np.array(missed), 1, 0)
    slack = 1e-3 * robot.weight
    assert (np.diff(force, axis=0) > -slack).all() and (np.diff(moment, axis=0) < slack).all()
    assert (force[-1] > force[0] + 3.0 * slack).all() and (moment[-1] < 0.2 * moment[0]).all()


# --- what does not matter ----------------------------------------------------------------------


def some_of_scene(scene: Scene, rows: np.ndarray) -> Scene:
    command = scene.command._replace(
        reference=scene.command.reference[rows], body=scene.command.body[rows]
    )
    parts = (some_of(part, rows) for part in (scene.state, scene.terms, scene.target))
    return Scene(scene.robot, *parts, command)


def turned(scene: Scene, angle: float, shift: np.ndarray) -> Scene:
    """The same, elsewhere in the world."""
    target, state = scene.target, scene.state
    qpos, turn = postures.turned(state.qpos, angle, shift)

    def both(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values[..., :3] @ turn.T, values[..., 3:] @ turn.T], axis=-1)

    def rates(qvel: np.ndarray) -> np.ndarray:
        return np.concatenate([qvel[:, :3] @ turn.T, qvel[:, 3:]], axis=1)

    target = target._replace(
        foot_position=target.foot_position @ turn.T + shift,
        world_from_foot=turn @ target.world_from_foot,
        foot_velocity=both(target.foot_velocity),
        foot_acceleration=both(target.foot_acceleration),
        com=target.com @ turn.T + shift,
        qpos=postures.turned(target.qpos, angle, shift)[0],
    )
    state = state._replace(qpos=qpos, qvel=rates(state.qvel))
    body = scene.command.body.copy()
    body[:, :2] = body[:, :2] @ turn[:2, :2].T
    command = scene.command._replace(reference=rates(scene.command.reference), body=body)
    terms = MuJoCoDynamics(scene.robot).terms(state.qpos, state.qvel)
    return Scene(scene.robot, state, terms, target, command)


@pytest.mark.parametrize(
    ("robot", "limits"), pairs(robots.ROBOTS, ["friction", "none"], 1), indirect=["robot"]
)
def test_neither_place_and_heading_nor_other_robots_matter(robot, rng, limits):
    """The others to the bit, also beside one that is not finite."""
    scene, law = scene_of(robot, rng, each=1), law_of(robot, contact_limits=limits)
    here, _ = torque_of(law, scene)
    there, _ = torque_of(law, turned(scene, 2.1, np.array([3.0, -7.0, 0.5])))
    # The forces' solver stops at its accuracy.
    np.testing.assert_allclose(there, here, atol=1e-3 * robot.weight * Stance.of(robot).size)
    for i in range(len(here)):
        alone, _ = torque_of(law, some_of_scene(scene, np.array([i])))
        np.testing.assert_array_equal(alone[0], here[i])
    for name in ("mass_matrix", "foot_jacobian", "foot_bias"):
        broken = getattr(scene.terms, name).copy()
        broken[1].flat[0] = np.nan
        torque, _ = torque_of(law, scene._replace(terms=scene.terms._replace(**{name: broken})))
        others = np.arange(len(torque)) != 1
        np.testing.assert_array_equal(torque[others], here[others])
        assert np.isnan(torque[1]).any()


def test_the_order_of_the_feet_does_not_matter(rng):
    one, order = robots.load("quadruped"), [2, 0, 3, 1]
    feet = {one.foot_names[foot]: QUADRUPED.feet[one.foot_names[foot]] for foot in order}
    other = Robot.from_mjcf(one.spec.copy(), feet, name="shuffled", home=QUADRUPED.home)
    scene = scene_of(one, rng)
    of_feet = ("planted", "load", "foot_position", "world_from_foot", "foot_velocity")
    of_feet = (*of_feet, "foot_acceleration", "foothold", "clipped")
    target = scene.target._replace(
        **{name: np.ascontiguousarray(getattr(scene.target, name)[:, order]) for name in of_feet}
    )
    terms = MuJoCoDynamics(other).terms(scene.state.qpos, scene.state.qvel)
    shuffled = Scene(other, scene.state, terms, target, scene.command)
    here, there = torque_of(law_of(one), scene)[0], torque_of(law_of(other), shuffled)[0]
    np.testing.assert_allclose(there, here, atol=1e-3 * one.weight * Stance.of(one).size)


# --- near singularities ------------------------------------------------------------------------


def straightening(robot: Robot, steps: int) -> Scene:
    """Robots whose legs go from bent to straight and beyond, all feet on the ground."""
    start, straight = bent(robot), np.zeros(robot.num_joints)
    qpos = np.repeat(start[None], steps, axis=0)
    qpos[:, 7:] += np.linspace(0.0, 1.1, steps)[:, None] * (straight - start[7:])
    still, body = np.zeros((steps, robot.nv)), np.tile([0.5, -0.3, 1.0, 0.4, -0.2, 0.3], (steps, 1))
    return standing(robot, qpos, still + 0.1, still, body)


def test_torques_go_through_straight_knees(robot):
    """Bounded, and continuous: with half the step there is about half of the change."""
    law, steepest, size = law_of(robot), [], robot.weight * Stance.of(robot).size
    for steps in (401, 801, 1601):
        torque, residual = torque_of(law, straightening(robot, steps))
        assert np.isfinite(torque).all() and np.isfinite(residual).all()
        assert np.abs(torque).max() < 10.0 * size
        steepest.append(np.abs(np.diff(torque, axis=0)).max())
    # Within 0.1 mrad of straight the direction in which a leg cannot move turns round.
    for change, before in zip(steepest[1:], steepest[:-1], strict=True):
        assert change < max(0.75 * before, 0.01 * size)


def test_contacts_that_are_given_up_are_reported(rng):
    """Of a robot on soles with five joints a leg, which hold each other in a sixth direction."""
    robot = zoo.built(zoo.draw(2))
    law, count = law_of(robot, friction=10.0), 20
    qpos = np.tile(robot.home_qpos, (count, 1))
    qpos[:, 7:] += 0.05 * rng.normal(size=(count, robot.num_joints))
    qvel = 0.1 * rng.normal(size=(count, robot.nv))
    scene = standing(robot, qpos, qvel, np.zeros((count, robot.nv)), np.zeros((count, 6)))
    _, residual = torque_of(law, scene)
    jacobian, bias = rows_of(scene, law)
    moved = np.linalg.norm(np.matvec(jacobian, desired_of(law, scene)) + bias, axis=1)
    found = moved / robot.gravity
    # Before limits, that is: what yields to them moves the feet by a little less or more.
    assert (residual > 0.9 * found).all() and found.min() > 1e-3
    assert np.median(np.abs(residual - found)) < 1e-3 * np.median(found)


def test_a_law_that_notices_slip_begins_with_half_of_the_friction_on_points(robot, rng):
    scene, law = scene_of(robot, rng), law_of(robot, notice_slip=True)
    torque, tick = torque_of(law, scene)[0], 1e-3 * robot.weight  # a tick raises it a little
    for share, same in ((0.5, not robot.has_soles), (1.0, robot.has_soles)):
        known, _ = torque_of(law_of(robot, friction=share * FRICTION), scene)
        assert np.allclose(torque, known, atol=tick) == same
