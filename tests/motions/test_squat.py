"""Squats: feet flat and still, knees that extend fully, the pressure under the soles."""

import numpy as np
import pytest

from fbid_gym.errors import FbidError
from fbid_gym.motions import MotionTable, periodic_squat, squat_bow
from fbid_gym.robots import load
from tests.motions.conftest import centre_of_pressure, hold_laws

TOE = 0.112  # m, half the length of a sole


@pytest.fixture(scope="module", params=[5.0, 1.0])
def bow(request):
    return squat_bow(load("biped"), speed=request.param, hz=500 if request.param > 1.0 else 200)


def joint(motion: MotionTable, name: str) -> np.ndarray:
    return motion.rows.qpos[:, 7 + motion.robot.joint_names.index(name)]


def some(motion: MotionTable) -> np.ndarray:
    return np.linspace(0, motion.period - 1, 97).astype(int)


def test_the_bow_keeps_its_feet_in_place(bow):
    hold_laws(bow, some(bow))


def test_the_squat_keeps_its_feet_in_place_and_the_pressure_within_its_soles():
    motion = periodic_squat(load("biped"))
    hold_laws(motion, some(motion))
    knee = joint(motion, "left_knee")
    assert motion.period == 250 and motion.periodic
    assert knee.max() - knee.min() == pytest.approx(0.3, abs=1e-3)
    assert not motion.rows.qvel[0].any()
    point, force = centre_of_pressure(motion, some(motion))  # at two hertz, in the soles
    assert np.abs(point[:, 0]).max() < 0.75 * TOE
    assert force[:, 2].min() > 0.7 * motion.robot.weight


def test_the_knees_extend_to_their_limit_and_not_beyond(bow):
    knee, speed = joint(bow, "left_knee"), round(30.0 / bow.seconds)
    assert knee.min() == 0.0
    top = round(20.0 / speed * bow.hz)
    assert knee[top] == 0.0 and knee[: top - bow.hz // 10].min() > 0.0
    assert np.array_equal(knee, joint(bow, "right_knee"))
    # At rest at the ends, so that it can be started from and held after.
    assert np.abs(bow.rows.qvel[[0, -1]]).max() < 1e-12


def test_the_centre_of_mass_stays_over_the_soles(bow):
    assert np.abs(bow.rows.com[:, 0]).max() < 0.012
    assert np.abs(bow.rows.com[:, 1]).max() < 1e-9
    point, force = centre_of_pressure(bow, some(bow))
    slow = bow.seconds > 20
    assert np.abs(point[:, 0]).max() < (0.015 if slow else 0.75 * TOE)
    assert force[:, 2].min() > (0.95 if slow else 0.6) * bow.robot.weight


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"frequency": 0.0}, "Invalid frequency"),
        ({"frequency": 3.0}, "Invalid frequency"),
        ({"knee": 0.2, "amplitude": 0.3}, r"Invalid motion of joint 'left_knee': -0\.1.*\[0, 2\.4"),
    ],
)
def test_numbers_that_make_no_squat_are_refused(numbers, message):
    with pytest.raises(FbidError, match=message):
        periodic_squat(load("biped"), **numbers)
    with pytest.raises(FbidError, match="Invalid speed: nan. Expected a positive finite number"):
        squat_bow(load("biped"), speed=float("nan"))
