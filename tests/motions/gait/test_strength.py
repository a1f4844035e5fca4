"""How briskly and how low robots walk: what of it weak legs can do."""

from dataclasses import replace

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.motions.gait.biped import biped_gait, deepest_bend, default_cycle, swing_time


def weaker(robot, name, share):
    """The robot with less torque in some of its joints."""
    limit = robot.torque_limit.copy()
    limit[[name in joint for joint in robot.joint_names]] *= share
    return replace(robot, torque_limit=limit)


@pytest.fixture(scope="module")
def robot():
    return robots.load("biped")


def test_weak_hips_swing_slowly_and_weak_knees_bend_less(robot):
    strong = biped_gait(robot, "brisk_walk")
    slow = biped_gait(weaker(robot, "hip_pitch", 0.3), "brisk_walk")
    assert slow.single > strong.single and slow.height == strong.height
    # In slow steps errors grow: the robot gathers speed more slowly, and pitches less.
    assert slow.agility[0] < strong.agility[0] and slow.moment[0] < strong.moment[0]
    slower = biped_gait(weaker(robot, "hip_pitch", 0.2), "brisk_walk")
    assert slower.top < strong.top and slower.single >= slow.single
    stiff = biped_gait(weaker(robot, "knee", 0.3), "brisk_walk")
    assert stiff.crouch < strong.crouch and stiff.height > strong.height


def test_a_step_takes_time_as_velocity_and_weakness_grow(robot):
    """And as the square of the share in the air falls."""
    least = swing_time(robot, 0.5, 0.9)
    assert swing_time(robot, 1.0, 0.9) == pytest.approx(2.0 * least)
    assert swing_time(robot, 0.5, 0.45) == pytest.approx(4.0 * least)
    half = replace(robot, torque_limit=0.5 * robot.torque_limit)
    assert swing_time(half, 0.5, 0.9) == pytest.approx(2.0 * least)


def test_a_walk_needs_no_strength(robot):
    weak = replace(robot, torque_limit=0.3 * robot.torque_limit)
    for one in (robot, weak):
        assert biped_gait(one).crouch == 0.0 and default_cycle(one, "walk") == 3.4
    assert deepest_bend(weak) < deepest_bend(robot)


def test_legs_bend_by_nine_tenths_of_what_their_joints_let_them(robot):
    """Turning them tells, to 10 %: the closed form knows nothing of the height of ankles."""
    room, spread = 0.3, robot.joint_range.copy()
    ankles = ["ankle_pitch" in name for name in robot.joint_names]
    spread[ankles] = robot.home_qpos[7:][ankles][:, None] + [-room, room]
    stiff = replace(robot, joint_range=spread)
    qpos = robot.home_qpos.copy()
    for name, turns in {"hip_pitch": 0.5, "knee": 1.0, "ankle_pitch": 0.5}.items():
        of = [name in joint for joint in robot.joint_names]
        qpos[7:][of] += np.sign(qpos[7:][of]) * turns * 2.0 * 0.9 * room
    heights = [MuJoCoDynamics(robot).terms(q[None], np.zeros((1, robot.nv))).foot_position[0, 0, 2]
               for q in (robot.home_qpos, qpos)]  # fmt: skip
    assert deepest_bend(stiff) == pytest.approx(heights[1] - heights[0], rel=0.1)
    assert biped_gait(stiff, "brisk_walk").crouch <= biped_gait(robot, "brisk_walk").crouch
    none = np.where(np.array(ankles)[:, None], robot.home_qpos[7:, None], robot.joint_range)
    assert deepest_bend(replace(robot, joint_range=none)) == pytest.approx(0.0, abs=1e-9)
