"""Haste: where it begins, how fast it comes, and what of it weak legs can do."""

from dataclasses import replace

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.motions.gait.biped import biped_gait
from fbid_gym.motions.gait.haste import gathered, haste_at


def weaker(robot, name, share):
    """The robot with less torque in some of its joints."""
    limit = robot.torque_limit.copy()
    limit[[name in joint for joint in robot.joint_names]] *= share
    return replace(robot, torque_limit=limit)


@pytest.fixture(scope="module")
def robot():
    return robots.load("biped")


def test_what_is_usual_is_done_without_haste(robot):
    """The velocities that environments of version 0 ask for: 0.14 of sqrt(g h)."""
    haste = biped_gait(robot).haste
    speed = 0.14 * np.sqrt(robot.gravity * robot.at_home.com[2])
    assert haste_at(haste, speed) == haste_at(haste, -speed) == haste_at(haste, 0.0) == 0.0
    assert haste_at(haste, haste.fast) == haste_at(haste, -haste.top) == 1.0
    assert 0.0 < haste_at(haste, 0.5 * (haste.usual + haste.fast)) < 1.0


def test_velocities_beyond_are_gathered_slowly_and_end_at_the_top(robot):
    haste, tick = biped_gait(robot).haste, 0.004
    assert gathered(haste, 0.0, 0.9 * haste.usual, tick) == 0.9 * haste.usual
    for sign in (1.0, -1.0):
        now, steps = sign * haste.usual, 0
        while abs(now) < haste.top:
            after = gathered(haste, now, sign * 9.0, tick)
            assert 0.0 < sign * (after - now) <= haste.gather * tick * (1.0 + 1e-9)
            now, steps = after, steps + 1
        least = (haste.top - haste.usual) / (haste.gather * tick)
        assert steps == pytest.approx(least, abs=1.0) and now == sign * haste.top
        back = gathered(haste, now, 0.0, tick)
        assert sign * (now - back) == pytest.approx(haste.gather * tick)


def test_weak_hips_swing_slowly_and_weak_knees_bend_less(robot):
    strong = biped_gait(robot).haste
    slow = biped_gait(weaker(robot, "hip_pitch", 0.3)).haste
    assert (
        slow.single + slow.double > strong.single + strong.double and slow.crouch == strong.crouch
    )
    slower = biped_gait(weaker(robot, "hip_pitch", 0.2)).haste
    assert slower.top < strong.top and slower.single >= slow.single
    stiff = biped_gait(weaker(robot, "knee", 0.3)).haste
    assert stiff.crouch < strong.crouch and stiff.single == strong.single
