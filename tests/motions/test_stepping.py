"""Stepping: the schedule, feet that stand and feet that lift, the pressure under the soles."""

import numpy as np
import pytest

from fbid_gym.dynamics import PinocchioDynamics
from fbid_gym.errors import FbidError
from fbid_gym.motions import Steps, stepping
from fbid_gym.robots import load
from tests.motions.conftest import centre_of_pressure, hold_laws

SOLE = np.array([0.112, 0.042])  # m, half its length and width


@pytest.fixture(scope="module", params=[0.0, 0.25])
def motion(request):
    return stepping(load("biped"), Steps(ramp=request.param))


def test_planted_feet_stay_in_place(motion):
    hold_laws(motion, np.arange(0, motion.period, 11))


def test_feet_take_turns_with_both_down_between(motion):
    assert motion.period == 1500 and motion.periodic
    assert motion.robot.foot_names == ("left", "right")
    down = motion.rows.planted
    switches = np.flatnonzero((down != np.roll(down, 1, axis=0)).any(axis=1))
    # Both, right, both, left, both: each foot is in the air for a quarter of 3 s.
    assert switches.tolist() == [188, 562, 938, 1312]
    both, right, left = [True, True], [False, True], [True, False]
    assert down[[0, 188, 562, 938, 1312]].tolist() == [both, right, both, left, both]


def test_postures_jump_only_where_feet_switch_and_only_without_ramp(motion):
    joints = motion.rows.qpos[:, 7:]
    change = np.abs(joints - np.roll(joints, 1, axis=0)).max(axis=1)
    jumps = np.flatnonzero(change > 0.05).tolist()
    assert motion.jumps is not None
    assert jumps == np.flatnonzero(motion.jumps).tolist()
    assert jumps in ([188, 562, 938, 1312], [])


def test_the_foot_in_the_air_clears_the_ground(motion):
    terms = PinocchioDynamics(motion.robot).terms(motion.rows.qpos, motion.rows.qvel)
    height = terms.foot_position[:, :, 2] - terms.foot_position[:, :, 2].min(axis=1)[:, None]
    assert height[motion.rows.planted].max() < 1e-9
    for middle, foot in ((375, 0), (1125, 1)):
        assert 0.02 < height[middle, foot] < 0.06
    # Level, and beside the other foot.
    assert np.abs(terms.world_from_foot - np.eye(3)).max() < 0.12
    gap = terms.foot_position[:, 0] - terms.foot_position[:, 1]
    assert np.abs(gap[:, :2] - [0.0, 0.18]).max() < 0.02


def test_the_pressure_stays_under_the_planted_soles(motion):
    rows = np.arange(0, motion.period, 3)
    point, force = centre_of_pressure(motion, rows)
    terms = PinocchioDynamics(motion.robot).terms(motion.rows.qpos[rows], motion.rows.qvel[rows])
    ramped = motion.jumps is not None and not motion.jumps.any()
    for foot in (0, 1):
        single = ~motion.rows.planted[rows, 1 - foot]
        from_sole = np.abs(point[single] - terms.foot_position[single, foot, :2])
        # Lifting a leg in a quarter of a second takes a moment that adds to the sway's.
        assert (from_sole.max(axis=0) < SOLE * (1.0 if ramped else 0.75)).all()
    both = motion.rows.planted[rows].all(axis=1)
    assert np.abs(point[both, 1]).max() < 0.09 + SOLE[1]
    assert force[:, 2].min() > 0.6 * motion.robot.weight


def test_feet_may_stand_farther_apart_than_at_home():
    wide = stepping(load("biped"), Steps(lift=(0.0, 0.0, 0.0), spread=0.05))
    narrow = stepping(load("biped"), Steps(lift=(0.0, 0.0, 0.0)))
    rows = np.arange(0, wide.period, 50)
    terms = PinocchioDynamics(wide.robot).terms(wide.rows.qpos[rows], wide.rows.qvel[rows])
    gap = terms.foot_position[:, 0] - terms.foot_position[:, 1]
    np.testing.assert_allclose(gap, np.tile([0.0, 0.28, 0.0], (len(rows), 1)), atol=1e-9)
    assert np.abs(terms.world_from_foot - np.eye(3)).max() < 1e-9
    # The base keeps its way: the legs reach out under it.
    np.testing.assert_allclose(wide.rows.qpos[:, :3], narrow.rows.qpos[:, :3], atol=1e-9)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"period": 0.0}, "Invalid period: 0.0"),
        ({"period": 1.0 / 300}, "Invalid stepping frequency"),
        ({"squat_frequency": 1.9}, "Invalid squat_frequency: 1.9. Expected a whole number of"),
        ({"single": 0.5}, "Invalid single: 0.5"),
        ({"ramp": 0.4}, "Invalid ramp: 0.4. Expected seconds between 0 and half the time .* 0.375"),
        ({"lift": (-0.1, 2.4, -0.1)}, "Invalid motion of joint 'left_knee': 3"),
    ],
)
def test_numbers_that_make_no_motion_are_refused(numbers, message):
    with pytest.raises(FbidError, match=message):
        stepping(load("biped"), Steps()._replace(**numbers))


def test_a_robot_without_two_legs_is_refused():
    with pytest.raises(FbidError, match="'quadruped' has 4 feet: front_left.* Expected two, left"):
        stepping(load("quadruped"))
