"""How briskly and how low robots walk: what of it weak legs can do."""

from dataclasses import replace

import pytest

from fbid_gym import robots
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
