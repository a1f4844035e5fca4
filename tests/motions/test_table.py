"""Motion tables: gathering, and what is refused."""

import dataclasses

import numpy as np
import pytest

from fbid_gym.errors import FbidError
from fbid_gym.motions import MotionTable, periodic_squat, squat_bow
from fbid_gym.quantities import Target
from fbid_gym.robots import load


@pytest.fixture(scope="module")
def periodic():
    return periodic_squat(load("biped"))


@pytest.fixture(scope="module")
def finite():
    return squat_bow(load("biped"), speed=30)


def test_a_periodic_motion_starts_again(periodic):
    tick = np.array([3, periodic.period + 3, 7 * periodic.period + 3, 10])
    reference = periodic.reference(tick)
    for part in reference:
        assert np.array_equal(part[0], part[1]) and np.array_equal(part[0], part[2])
    assert np.array_equal(reference.qpos[3], periodic.rows.qpos[10])
    assert np.array_equal(reference.qacc[3], periodic.rows.qacc[10])
    assert reference.planted.all() and (reference.load == 1.0).all()


def test_a_finite_motion_ends_in_its_last_posture_at_rest(finite):
    reference = finite.reference(np.array([finite.period - 1, finite.period, 10**6]))
    assert np.array_equal(reference.qpos, np.tile(finite.rows.qpos[-1], (3, 1)))
    assert np.array_equal(reference.com, np.tile(finite.rows.com[-1], (3, 1)))
    assert np.abs(reference.qacc[0]).max() > 1.0
    for rate in (reference.qvel, reference.qacc, reference.com_velocity):
        assert not rate[1:].any()
    assert not reference.com_acceleration[1:].any()


def changed(motion: MotionTable, name: str, change: object) -> dict[str, Target]:
    array = getattr(motion.rows, name).copy()
    change(array)  # type: ignore[operator]
    return {"rows": motion.rows._replace(**{name: array})}


def bend(qpos):
    qpos[31, 7 + load("biped").joint_names.index("right_knee")] = -0.05


def stretch(qpos):
    qpos[5, 3:7] *= 1.1


def halve(rates):
    rates *= 0.5


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("qpos", bend, r"joint 'right_knee': -0.05. Expected angles in its range \[0, 2.4\] .*31"),
        ("qpos", stretch, "base quaternion of the motion at tick 5.*unit length"),
        ("qvel", halve, r"Invalid qvel of the motion: .* for joint '\w+' at tick"),
        ("qacc", halve, r"Invalid qacc of the motion: .* for joint '\w+' at tick"),
    ],
)
def test_what_is_no_motion_is_refused(periodic, finite, name, change, message):
    with pytest.raises(FbidError, match=message):
        dataclasses.replace(periodic, **changed(periodic, name, change))
    with pytest.raises(FbidError, match="Invalid qvel of the motion: .* at tick 0"):
        dataclasses.replace(finite, periodic=True)  # its seam does not close


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("qvel", np.zeros((250, 3)), r"qvel of the motion has shape \(250, 3\).*\(250, 22"),
        ("planted", np.ones((250, 4), bool), r"planted of the motion has .*Expected \(250, 2\)"),
        ("qacc", np.full((250, 22), np.nan), "qacc of the motion is not finite"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(periodic, name, value, message):
    with pytest.raises(FbidError, match=message):
        dataclasses.replace(periodic, rows=periodic.rows._replace(**{name: value}))
    with pytest.raises(FbidError, match=r"jumps has shape \(3,\). Expected \(250,\)"):
        dataclasses.replace(periodic, jumps=np.ones(3, bool))


def test_a_jump_is_refused_unless_announced(finite):
    hip = 7 + finite.robot.joint_names.index("left_hip_roll")

    def jump(qpos: np.ndarray) -> None:
        qpos[200:, hip] += 0.1

    array = changed(finite, "qpos", jump)
    with pytest.raises(FbidError, match="Invalid qvel .* joint 'left_hip_roll' at tick 200"):
        dataclasses.replace(finite, **array)
    jumps = np.arange(finite.period) == 200
    dataclasses.replace(finite, **array, jumps=jumps)
