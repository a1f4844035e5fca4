"""Hips, knees and ankles are found from the kinematics: names, signs and sizes do not matter."""

import mujoco
import numpy as np
import pytest

from fbid_gym.dynamics import PinocchioDynamics
from fbid_gym.dynamics.contacts import contact_geometry, point_positions
from fbid_gym.errors import FbidError
from fbid_gym.motions import squat_bow, squat_depth, stepping, steps_for
from fbid_gym.motions.legs import least_bend, legs_of
from fbid_gym.robots import Robot, load
from fbid_gym.robots.built_in import BIPED, asset_path
from fbid_gym.robots.polygon import margin_within
from tests.motions.conftest import centre_of_pressure, hold_laws
from tests.robots.similar import similar


def other_way_round() -> Robot:
    """The biped with other names, its knees and one hip counting backwards."""
    spec = mujoco.MjSpec.from_file(str(asset_path(BIPED.asset)))
    names = {}
    for number, joint in enumerate(spec.joints[1:]):
        names[joint.name] = f"j{number}"
        if "knee" in joint.name or joint.name == "left_hip_pitch":
            joint.axis, joint.range = -joint.axis, -joint.range[::-1]
    turned = {"left_knee", "right_knee", "left_hip_pitch"}
    home = {names[name]: -angle if name in turned else angle for name, angle in BIPED.home.items()}
    for actuator in spec.actuators:
        actuator.target = names[actuator.target]
    for joint in spec.joints[1:]:
        joint.name = names[joint.name]
    return Robot.from_mjcf(spec, BIPED.feet, name="other way round", home=home)


@pytest.mark.parametrize("name", ["biped", "humanoid", "g1"])
def test_legs_are_found(name):
    robot = load(name)
    legs = legs_of(robot)
    named = np.array(robot.joint_names)[legs.pitch]
    pitch = "hip_pitch", "knee", "ankle_pitch"
    assert named.tolist() == [[f"{side}_{joint}" for joint in pitch] for side in ("left", "right")]
    for side, joints in zip(("left", "right"), legs.joints, strict=True):
        assert all(robot.joint_names[joint].startswith(side) for joint in joints)
    assert legs.bend == pytest.approx(robot.home_qpos[7 + legs.pitch[0, 1]], abs=1e-3)
    assert legs.forward == 1.0 and least_bend(legs) == 0.0


def test_names_and_signs_do_not_matter():
    own, other = load("biped"), other_way_round()
    assert legs_of(other).sign.tolist() == [[-1, -1, 1], [1, -1, 1]]
    for motion in (
        lambda robot: squat_bow(robot, speed=5.0),
        lambda robot: stepping(robot, steps_for(robot, 500)),
    ):
        rows, expected = motion(other).rows, motion(own).rows
        np.testing.assert_allclose(rows.com, expected.com, atol=1e-9)
        np.testing.assert_allclose(rows.qpos[:, :7], expected.qpos[:, :7], atol=1e-9)
        np.testing.assert_allclose(abs(rows.qpos), abs(expected.qpos), atol=1e-9)
        assert np.array_equal(rows.planted, expected.planted)


def test_similar_robots_move_alike_each_in_its_own_time():
    size = 4.0
    own, other = load("biped"), similar("biped", size)
    hz = round(500 / np.sqrt(size))
    for motion in (
        lambda robot, hz: squat_bow(robot, speed=5.0, hz=hz),
        lambda robot, hz: stepping(robot, steps_for(robot, hz), hz=hz),
    ):
        rows, expected = motion(other, hz).rows, motion(own, 500).rows
        same = min(len(rows.qpos), len(expected.qpos)) // 4  # rates are rounded, times drift apart
        np.testing.assert_allclose(rows.com[:same] / size, expected.com[:same], atol=2e-3)
        np.testing.assert_allclose(rows.qpos[:same, 7:], expected.qpos[:same, 7:], atol=2e-2)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["humanoid", "g1"])
def test_other_robots_squat_and_step_over_their_feet(name):
    robot = load(name)
    legs = legs_of(robot)
    # At speed 5 the humanoid's centre of pressure would leave its soles.
    squat, step = squat_bow(robot, speed=3.0), stepping(robot, steps_for(robot, 500))
    knee = squat.rows.qpos[:, 7 + legs.pitch[:, 1]]
    assert np.ptp(knee) > 0.9 * squat_depth(robot)
    assert knee.min() - robot.home_qpos[7 + legs.pitch[0, 1]] == pytest.approx(-legs.bend, abs=1e-5)
    for motion in (squat, step):
        rows = np.linspace(0, motion.period - 1, 83).astype(int)
        hold_laws(motion, rows)
        point, force = centre_of_pressure(motion, rows)
        assert force[:, 2].min() > 0.7 * robot.weight
        planted = motion.rows.planted[rows].repeat([foot.num_points for foot in robot.feet], axis=1)
        terms = PinocchioDynamics(robot).terms(motion.rows.qpos[rows], motion.rows.qvel[rows])
        points = point_positions(contact_geometry(robot), terms)
        for place, down, corners in zip(point, planted, points, strict=True):
            assert margin_within(corners[down, :2], place[:2]) > 0.0


def test_legs_that_are_none_are_refused():
    robot = load("biped")
    spec = robot.spec.copy()
    for joint in spec.joints:
        if joint.name == "left_knee":
            joint.axis = [1.0, 0.0, 0.0]
    sideways = Robot.from_mjcf(spec, BIPED.feet, name="sideways", home=BIPED.home)
    expected = "Leg 'left' .* about the axis to the side: left_hip_pitch. Expected"
    with pytest.raises(FbidError, match=expected):
        legs_of(sideways)
