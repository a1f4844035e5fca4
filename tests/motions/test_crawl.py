"""The crawl: three feet down, the centre of mass between them, as fast as it is told."""

import functools

import numpy as np
import pytest

from fbid_gym.dynamics import PinocchioDynamics
from fbid_gym.dynamics.frames import rotation_vector
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import FbidError
from fbid_gym.motions import Crawl, CrawlGait, MotionTable, crawl, gait_for
from fbid_gym.robots import ROBOTS, load, zoo
from fbid_gym.robots.polygon import margin_within
from tests.motions.conftest import centre_of_pressure, hold_laws
from tests.robots.similar import moved, similar


@functools.cache
def crawled(robot: str | int) -> Crawl:
    """The crawl of a robot, built in or of the zoo: at its least and greatest speed.

    The quadruped's is planned in between, too.
    """
    own = load(robot) if robot in ROBOTS else zoo.built(zoo.draw(robot))
    return crawl(own) if robot == "quadruped" else crawl(own, gait_for(own, 500)._replace(tables=2))


@pytest.fixture(scope="module")
def walk():
    return crawled("quadruped")


@pytest.fixture(scope="module", params=["quadruped", "go1", 42])  # five joints a leg
def any_walk(request):
    return crawled(request.param)


def feet_of(motion: MotionTable, rows: np.ndarray) -> np.ndarray:
    terms = PinocchioDynamics(motion.robot).terms(motion.rows.qpos[rows], motion.rows.qvel[rows])
    return terms.foot_position


def margins(points: np.ndarray, planted: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """How far points (K, 2) are within the polygons of the planted of the feet (K, 4, 2)."""
    each = zip(points, planted, inside, strict=True)
    return np.array([margin_within(feet[down], point) for feet, down, point in each])


@pytest.mark.slow
def test_planted_feet_neither_move_nor_accelerate(any_walk):
    for table in (any_walk.tables[0], any_walk.tables[-1]):
        hold_laws(table, np.arange(0, table.period, 9))


def test_one_foot_swings_at_a_time_and_each_once(walk):
    planted = walk.tables[0].rows.planted
    for table in walk.tables:
        assert np.array_equal(table.rows.planted, planted)
    assert planted.sum(axis=1).min() == 3
    assert ((~planted).sum(axis=0) == 120).all()
    first = [int(np.flatnonzero(~column)[0]) for column in planted.T]
    order = [walk.tables[0].robot.foot_names[foot] for foot in np.argsort(first)]
    assert order == ["hind_left", "front_left", "hind_right", "front_right"]


@pytest.mark.slow
def test_the_walk_could_stop_anywhere(any_walk):
    """The centre of mass stays over the planted feet, and so does the centre of pressure."""
    robot, walk = any_walk.tables[0].robot, any_walk
    height = Stance.of(robot).home_com[2]
    least = {"quadruped": 0.02, "go1": 0.05 * height}.get(robot.name, 0.0)
    rows = np.arange(0, walk.period, 6)
    for table in walk.tables:
        feet, planted = feet_of(table, rows)[:, :, :2], table.rows.planted[rows]
        assert margins(feet, planted, table.rows.com[rows, :2]).min() > least
        # On the ground, that is, above which the frame's origin is while a foot is up.
        wrench_at, force = centre_of_pressure(table, rows)
        ground = feet_of(table, rows)[:, :, 2].min(axis=1)[:, None]
        point = wrench_at + ground * force[:, :2] / force[:, 2:]
        assert margins(feet, planted, point).min() > least
        if robot.name in ROBOTS:  # the legs of the other weigh more than its trunk
            assert np.abs(force[:, 2] / robot.weight - 1.0).max() < 0.1


def test_it_moves_as_fast_as_commanded(walk):
    for speed, table in zip(walk.speeds, walk.tables, strict=True):
        # The base does not turn, but the feet's heading does, so its own axes are what to look at.
        quaternion = table.rows.qpos[:, 3:7]
        yaw = 2 * np.arctan2(quaternion[:, 3], quaternion[:, 0])
        ahead = np.cos(yaw) * table.rows.qvel[:, 0] + np.sin(yaw) * table.rows.qvel[:, 1]
        assert ahead.mean() == pytest.approx(speed, abs=1e-9)
        assert not table.rows.qvel[:, 3:6].any() and np.abs(quaternion[:, 1:3]).max() < 1e-12


def test_feet_lift_as_high_as_told_and_come_down_gently(walk):
    table = walk.tables[-1]
    terms = PinocchioDynamics(table.robot).terms(table.rows.qpos, table.rows.qvel)
    height = terms.foot_position[:, :, 2]
    height = height - height.min(axis=1)[:, None]
    assert height[table.rows.planted].max() < 1e-9
    np.testing.assert_allclose(height.max(axis=0), 0.05, atol=1e-3)
    for foot in range(4):
        planted = table.rows.planted[:, foot]
        before = np.flatnonzero(planted & ~np.roll(planted, 1)) - 2
        assert np.abs(terms.foot_velocity[before, foot, :3]).max() < 0.02


def test_left_and_right_take_turns_in_the_same_motion(walk):
    table = walk.tables[2]
    names = table.robot.joint_names
    joints, mirrored = table.rows.qpos[:, 7:], np.empty_like(table.rows.qpos[:, 7:])
    for column, name in enumerate(names):
        other = name.replace("left", "?").replace("right", "left").replace("?", "right")
        sign = -1.0 if "roll" in name else 1.0
        mirrored[:, column] = sign * joints[:, names.index(other)]
    np.testing.assert_allclose(np.roll(mirrored, table.period // 2, axis=0), joints, atol=1e-9)


def test_between_planned_speeds_it_is_nearly_what_would_be_planned(walk):
    speed = 0.3 * walk.speeds[0] + 0.7 * walk.speeds[1]
    exact = crawl(load("quadruped"), CrawlGait(slowest=speed, fastest=speed, tables=1))
    tick = np.arange(0, walk.period, 3)
    found = walk.reference(tick, np.full(len(tick), speed))
    wanted = exact.reference(tick, np.full(len(tick), speed))
    assert np.array_equal(found.planted, wanted.planted)
    assert np.abs(found.qpos - wanted.qpos).max() < 1e-3
    assert np.abs(found.com - wanted.com).max() < 1e-4
    assert np.abs(found.qvel - wanted.qvel).max() < 2e-3 * np.abs(wanted.qvel).max()
    assert np.abs(found.qacc - wanted.qacc).max() < 5e-3 * np.abs(wanted.qacc).max()
    np.testing.assert_allclose(np.linalg.norm(found.qpos[:, 3:7], axis=1), 1.0, atol=1e-12)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"period": -1.0}, "Invalid period: -1.0. Expected a positive number of seconds"),
        ({"period": 0.0011}, "Invalid stride frequency"),
        ({"swing": 0.3}, r"Invalid swing: 0.3. Expected a share of the period in \(0, 0.25\)"),
        ({"swing_height": 0.0}, "Invalid swing_height: 0.0. Expected a positive number of metres"),
        ({"fastest": -0.1}, "Invalid fastest: -0.1. Expected no less than `slowest`"),
        ({"tables": 1}, "Invalid tables: 1. Expected 2 to 6 speeds"),
        ({"fastest": 0.4}, r"Invalid motion of foot '\w+': .* m out of reach at tick \d+"),
        ({"swing_height": 0.15}, "Invalid motion of "),
    ],
)
def test_numbers_that_make_no_gait_are_refused(numbers, message):
    with pytest.raises(FbidError, match=message):
        crawl(load("quadruped"), CrawlGait()._replace(**{"tables": 2, **numbers}))


def test_a_robot_of_four_times_the_size_takes_steps_of_four_times_the_length():
    small, large = (gait_for(similar("go1", size), 10_000) for size in (0.5, 2.0))
    units = [2.0, 1.0, *[4.0] * 3, 1.0, *[4.0] * 2, *[2.0] * 2, 1.0]
    np.testing.assert_allclose(large, np.array(small) * units, rtol=2e-4)


def test_the_base_keeps_its_heading_while_the_feets_changes(walk):
    """The support frame turns with the feet's layout; the base does not turn in the world."""
    table = walk.tables[-1]
    terms = PinocchioDynamics(table.robot).terms(table.rows.qpos, table.rows.qvel)
    heading = rotation_vector(terms.world_from_base)[:, 2]
    assert 0.01 < np.ptp(heading) < 0.4
    assert abs(heading.mean()) < 1e-9


def test_where_the_base_has_its_origin_does_not_matter():
    gait = gait_for(load("quadruped"), 250, speeds=(0.04, 0.04))._replace(tables=1)
    one, other = (
        crawl(robot, gait, hz=250).tables[0].rows
        for robot in (load("quadruped"), moved("quadruped", 0.05, 0.02, 0.1))
    )
    np.testing.assert_allclose(other.com, one.com, atol=1e-9)
    np.testing.assert_allclose(other.qpos[:, 7:], one.qpos[:, 7:], atol=1e-8)


def test_a_centre_of_mass_beyond_the_planted_feet_is_refused():
    gait = gait_for(load("quadruped"), 250, speeds=(0.04, 0.04))
    gait = gait._replace(tables=1, sway=-gait.sway)
    with pytest.raises(FbidError, match=r"centre of mass 0\.0.* m beyond its feet"):
        crawl(load("quadruped"), gait, hz=250)
