"""Planning kinematics: exact derivatives by differences in time, and what cannot be planned."""

import numpy as np
import pytest

from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.frames import quaternion_to_matrix, rotation_vector
from fbid_gym.errors import FbidError
from fbid_gym.motions.curves import Curve, cosine, rise
from fbid_gym.motions.kinematics import (
    States,
    base_on_feet,
    home_points,
    joints_on_feet,
    seen_from_feet,
)
from fbid_gym.motions.legs import legs_in_plane
from fbid_gym.robots import load
from tests.postures import turned

HZ = 1000
TIME = np.arange(150) / HZ


def derivative(values: np.ndarray) -> np.ndarray:
    """Fourth-order differences in time; the two rows at either end are missing."""
    near, far = values[3:-1] - values[1:-3], values[4:] - values[:-4]
    return (8 * near - far) * HZ / 12


def hold_rates(states: States) -> None:
    """Assert that velocities and accelerations of a motion in one world are its derivatives."""
    inner = slice(2, -2)
    rotation = quaternion_to_matrix(states.qpos[:, 3:7])
    turned = rotation_vector(rotation[1:-1].mT @ rotation[2:]) - rotation_vector(
        rotation[1:-1].mT @ rotation[:-2]
    )
    np.testing.assert_allclose(derivative(states.qpos[:, :3]), states.qvel[inner, :3], atol=1e-6)
    np.testing.assert_allclose(0.5 * HZ * turned, states.qvel[1:-1, 3:6], atol=1e-3)
    np.testing.assert_allclose(derivative(states.qpos[:, 7:]), states.qvel[inner, 6:], atol=1e-6)
    np.testing.assert_allclose(derivative(states.qvel), states.qacc[inner], atol=1e-4)


@pytest.fixture
def biped():
    return load("biped")


def test_curves_know_their_derivatives():
    curve = rise(TIME, 0.02, 0.12).plus(cosine(TIME, 3.0, 0.4), cosine(TIME, 5.0).scaled(0.3))
    np.testing.assert_allclose(derivative(curve.value), curve.rate[2:-2], atol=2e-2)
    smooth = cosine(TIME, 3.0, 0.4).plus(cosine(TIME, 5.0)).scaled(2.0, 7.0)
    np.testing.assert_allclose(derivative(smooth.value), smooth.rate[2:-2], atol=1e-4)
    np.testing.assert_allclose(derivative(smooth.rate), smooth.acceleration[2:-2], atol=1e-2)
    start = rise(TIME, 0.02, 0.12)
    assert start.value[[0, 20]].tolist() == [0.0, 0.0] and start.value[[120, -1]].tolist() == [1, 1]
    assert not any(start.rate[[0, 20, 120, -1]]) and not any(start.acceleration[[0, 20, 120, -1]])


def test_the_base_follows_from_the_joints_on_planted_feet(biped):
    """On one foot any joint motion will do: all joints move, and the base turns in space."""
    rng = np.random.default_rng(4)
    phase, size = rng.uniform(0, 6, biped.num_joints), rng.uniform(0.05, 0.2, biped.num_joints)
    parts = [cosine(TIME, 2.0, p).scaled(s) for p, s in zip(phase, size, strict=True)]
    joints = Curve(*(np.stack(part, axis=1) for part in zip(*parts, strict=True)))
    joints = Curve(joints.value + biped.home_qpos[7:], joints.rate, joints.acceleration)
    planted = np.tile([True, False], (len(TIME), 1))
    points = home_points(biped)
    states = base_on_feet(biped, joints, points, planted)
    assert np.abs(states.qvel[:, :6]).max() > 0.3
    hold_rates(states)
    terms = MuJoCoDynamics(biped).terms(states.qpos, states.qvel)
    assert np.abs(terms.foot_velocity[:, 0]).max() < 1e-10
    assert np.abs(terms.foot_velocity[:, 1]).max() > 0.5


def test_joints_follow_from_the_base_and_the_feet(biped):
    bend = cosine(TIME, 2.0).scaled(-0.1, 0.7)
    plane = legs_in_plane(biped, bend, bend.scaled(0.0))
    points = home_points(biped)
    base = base_on_feet(biped, plane, points)
    sway = cosine(TIME, 1.0, 1.0).scaled(0.06)
    for whole, part in zip(base, sway, strict=True):
        whole[:, 1] += part
    lifted = cosine(TIME, 3.0).scaled(-0.02, 0.02)
    centres = np.stack([points[:4].mean(axis=0), points[4:].mean(axis=0)])
    place = Curve(*np.zeros((3, len(TIME), 2, 3)))
    place.value[:] += centres
    for whole, part in zip(place, lifted, strict=True):
        whole[:, 0, 2] += part
        whole[:, 0, 0] += 2 * part
    planted = np.tile([False, True], (len(TIME), 1))
    names = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
    moving = [
        biped.joint_names.index(f"{side}_{name}") for side in ("left", "right") for name in names
    ]
    states = joints_on_feet(biped, base, lambda *_: place, planted, moving, plane.value)
    hold_rates(states)
    terms = MuJoCoDynamics(biped).terms(states.qpos, states.qvel)
    where = place.value - [0.0, 0.0, 0.008]
    np.testing.assert_allclose(terms.foot_position, where, atol=1e-10)
    np.testing.assert_allclose(terms.foot_velocity[:, :, :3], place.rate, atol=1e-9)
    assert np.abs(terms.foot_velocity[:, 1]).max() < 1e-9
    np.testing.assert_allclose(
        terms.world_from_foot[:, 0], np.tile(np.eye(3), (150, 1, 1)), atol=1e-9
    )


def test_planted_feet_that_would_part_are_refused(biped):
    joints = legs_in_plane(biped, cosine(TIME, 2.0).scaled(-0.1, 0.7), cosine(TIME, 1.0).scaled(0))
    joints.value[:, biped.joint_names.index("left_knee")] += 0.05
    with pytest.raises(FbidError, match=r"joint motion: 'planted feet part by 0\.\d+ m at tick"):
        base_on_feet(biped, joints, home_points(biped))


def test_too_few_planted_points_are_refused():
    robot = load("quadruped")
    still = np.zeros((3, robot.num_joints))
    planted = np.array([[True] * 4, [True, False, False, True], [True] * 4])
    with pytest.raises(FbidError, match="planted feet: 'too few contact points at tick 1'"):
        base_on_feet(
            robot, Curve(still + robot.home_qpos[7:], still, still), home_points(robot), planted
        )


def test_what_is_seen_from_the_feet_does_not_depend_on_where_they_stand(biped):
    rng = np.random.default_rng(0)
    qvel, qacc = rng.normal(size=(2, 1, biped.nv))
    qpos = biped.home_qpos[None].copy()
    seen = seen_from_feet(biped, States(qpos, qvel, qacc))
    moved, turn = turned(qpos, 0.7, np.array([3.0, -2.0, 0.4]))
    fast, faster = qvel.copy(), qacc.copy()
    fast[:, :3], faster[:, :3] = qvel[:, :3] @ turn.T, qacc[:, :3] @ turn.T
    again = seen_from_feet(biped, States(moved, fast, faster))
    for one, other in zip(seen[:6], again[:6], strict=True):
        np.testing.assert_allclose(other, one, atol=1e-9)
