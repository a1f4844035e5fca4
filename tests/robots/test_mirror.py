"""The mirror symmetry of a robot is that of its physics, or there is none."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from fbid_gym.errors import RobotError
from fbid_gym.robots import ROBOTS, Robot, load
from fbid_gym.robots.mirror import mirror_of
from tests.postures import in_mirror
from tests.robots.similar import turned


def after(robot: Robot, qpos: np.ndarray, qvel: np.ndarray, torque: np.ndarray):
    """Where a robot is 20 steps of physics later, on the ground."""
    data = mujoco.MjData(robot.model)
    data.qpos[:], data.qvel[:] = qpos, qvel
    data.ctrl[robot.actuator] = torque / robot.gear
    touched = 0
    for _ in range(20):
        mujoco.mj_step(robot.model, data)
        touched += data.ncon
    assert touched
    return data.qpos[None], data.qvel[None]


@pytest.mark.parametrize("name", [*ROBOTS, "front is hind", "zoo:5"])
def test_mirrored_states_and_torques_come_to_mirrored_states(name, rng):
    robot = turned("quadruped", (0, 0, 1), np.pi / 2) if name == "front is hind" else load(name)
    mirror = mirror_of(robot)
    room = (robot.joint_range - robot.home_qpos[7:, None]).T
    np.testing.assert_allclose(np.sort(mirror.joints.of(room), axis=0), room, atol=1e-9)
    for same in (robot.torque_limit, robot.joint_damping):
        np.testing.assert_allclose(same[mirror.joints.entry], same)
    qpos, qvel = robot.home_qpos[None].copy(), 0.3 * rng.normal(size=(1, robot.nv))
    qpos[:, 3:7] += 0.02 * rng.normal(size=4)
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7])
    qpos[:, 7:] += 0.02 * rng.normal(size=robot.num_joints)
    torque = 0.2 * rng.normal(size=robot.num_joints) * robot.torque_limit
    there = in_mirror(robot, *after(robot, qpos[0], qvel[0], torque))
    other = in_mirror(robot, qpos, qvel)
    here = after(robot, other[0][0], other[1][0], mirror.joints.of(torque))
    for one, same in zip(there, here, strict=True):
        np.testing.assert_allclose(one, same, atol=1e-9)
    for once, back in zip((qpos, qvel), in_mirror(robot, *other), strict=True):
        np.testing.assert_allclose(once, back, atol=1e-12)


def test_sides_are_told_by_places(rng):
    """Left and right change, and what is in the middle stays where it is."""
    robot = load("humanoid")
    mirror, names = mirror_of(robot), robot.joint_names
    for name, other in zip(names, mirror.joints.entry, strict=True):
        swapped = name.replace("left", "*").replace("right", "left").replace("*", "right")
        assert names[other] == swapped
    np.testing.assert_array_equal(mirror.feet.entry, [1, 0])
    points = robot.points_at_home * [1.0, -1.0, 1.0]
    np.testing.assert_allclose(points[mirror.points.entry], robot.points_at_home, atol=1e-9)


TEXT = (Path(__file__).parents[2] / "assets" / "quadruped.xml").read_text()
TRUNK, SHIN = '<inertial pos="0 0 0" mass="1.8"', 'mass="0.0464"'
ASIDE = TEXT.replace(TRUNK, TRUNK.replace("0 0 0", "0 0.02 0"))
HEAVY = TEXT.replace(SHIN, 'mass="0.1"', 1)


@pytest.mark.parametrize(
    ("text", "options", "why"),
    [
        (TEXT, {"torque_limit": {"front_left_knee": 0.5}}, "'front_left_knee' has another t"),
        (TEXT, {"armature": {"hind_right_knee": 0.5}}, "has another armature than its counter"),
        (TEXT, {"home": {"front_left_hip_roll": 0.2}}, "'front_left_hip_pitch' has no counter"),
        (ASIDE, {"home": {}}, "another centre of mass"),
        (HEAVY, {"home": {}}, "'front_left_lower_leg' has another mass"),
    ],
)
def test_a_robot_without_symmetry_is_refused_with_the_reason(text, options, why):
    robot = Robot.from_mjcf(text, name="lame", **options)
    with pytest.raises(RobotError, match=f"Robot 'lame' has no mirror symmetry: .*{why}"):
        mirror_of(robot)
