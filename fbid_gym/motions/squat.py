"""Squats on two flat feet, [M10] IV.B and IV.C: sinusoids at hip, knee and ankle.

The paper shows plots and no formulas. Here knee and trunk pitch are sinusoids, and the ankle is
linear in both, so that all three joint angles are combined sinusoids and the centre of mass stays
over the soles, see `legs.lean_of`:

    ankle = offset + per_knee knee + per_pitch pitch,   hip = -knee - ankle - pitch

The second equation keeps the soles flat, so the feet stay where they are whatever the sinusoids.
Angles count from the home posture, but for the knee: 0 is a straight leg.
"""

import numpy as np

from fbid_gym.checks import check_positive
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.curves import Curve, cosine, rise
from fbid_gym.motions.kinematics import base_on_feet, home_points, seen_from_feet
from fbid_gym.motions.legs import least_bend, legs_in_plane, legs_of, refuse_beyond
from fbid_gym.motions.table import MotionTable, table_ticks
from fbid_gym.robots import Robot
from fbid_gym.robots.polygon import convex_hull, margin_within

SECONDS = 30.0
"""Length of the squat/bow at speed 1, s, for a robot of the built-in biped's size."""

BIPED_FALLING_RATE = 3.7299790106475283
"""Of that biped, 1/s; robots that fall slower move as much slower."""

_SQUAT_HZ, _BOW_HZ = 0.2, 0.1
# Deep enough that at 5 times the speed joint feedback alone falls for nearly all gains; the centre
# of pressure then comes within 3 cm of the tips of the soles, and the ground carries 0.6 to 1.7 of
# the weight.
_KNEE, _SQUAT_DEPTH, _BOW_DEPTH = 0.45, 1.4, 0.6  # rad
_EXTENSION = (5.0, 20.0)  # s
_SAMPLES, _SPARE = 3001, 1e-3  # rad, more than a joint moves beyond its samples


def squat_bow(
    robot: Robot, *, speed: float = 1.0, depth: float | None = None, hz: int = 500
) -> MotionTable:
    """Squat and bow in the sagittal plane while the knees extend fully, [M10] IV.B, figures 3-5.

    At speed 1 a squat of 1.4 rad at the knee every 5 s is combined with a bow of the trunk of
    0.6 rad every 10 s. The knee angle at the top of the squats is 0.45 rad in the first 5 s and
    falls to 0, its limit, at 20 s; the tops at 20, 25 and 30 s are at full extension, the second of
    them in a bow. The motion starts and ends at rest. Robots that fall slower than the built-in
    biped squat as much slower, and the knees of others stop where their ranges do.

    Args:
        robot: one on two soles, with hips, knees and ankles that pitch.
        speed: how many times faster than that; [M10] figure 5 shows 5.
        depth: rad, of the squat at the knee. None: see `squat_depth`.
        hz: ticks per second.

    Raises:
        RobotError: the robot has no such legs.
        InvalidValueError: `speed` or `depth` is not positive and finite, or the motion leaves a
            joint's range or the feet.
    """
    check_positive(speed=speed)
    pace = speed * Stance.of(robot).falling_rate / BIPED_FALLING_RATE
    time = np.arange(table_ticks("speed", speed, SECONDS / pace, hz) + 1) / hz
    tops, squats, pitch = _squats_and_bows(robot, time, pace)
    if depth is None:
        depth = squat_depth(robot)
    check_positive(depth=depth)
    joints = legs_in_plane(robot, tops.plus(squats.scaled(depth)), pitch)
    return _on_flat_feet(robot, joints, hz, periodic=False)


def squat_depth(robot: Robot) -> float:
    """Return how deep `squat_bow` is: 1.4 rad at the knee, or as deep as the joints' ranges allow.

    Raises:
        RobotError: the robot has not two legs that bend.
    """
    tops, squats, pitch = _squats_and_bows(robot, np.linspace(0.0, SECONDS, _SAMPLES), 1.0)
    upright = legs_in_plane(robot, tops, pitch).value
    more = legs_in_plane(robot, tops.plus(squats), pitch).value - upright
    low, high = robot.joint_range.T
    room, moves = np.where(more > 0.0, high - _SPARE - upright, low + _SPARE - upright), more != 0.0
    return min(_SQUAT_DEPTH, float((room[moves] / more[moves]).min()))


def periodic_squat(
    robot: Robot,
    *,
    frequency: float = 2.0,
    knee: float = 0.6,
    amplitude: float = 0.15,
    hz: int = 500,
) -> MotionTable:
    """Squat periodically: sinusoids at hip, knee and ankle, the trunk upright, [M10] IV.C.

    It begins at the top, at rest.

    Args:
        robot: one on two soles, with hips, knees and ankles that pitch.
        frequency: Hz; a period shall be a whole number of ticks.
        knee: rad, mean of how far the knees are bent.
        amplitude: rad, of that.
        hz: ticks per second.

    Raises:
        RobotError: the robot has no such legs.
        InvalidValueError: a number is not valid, or the motion leaves a joint's range or the feet.
    """
    time = np.arange(period_ticks("frequency", frequency, hz)) / hz
    bend = cosine(time, frequency).scaled(-amplitude, knee)
    return _on_flat_feet(robot, legs_in_plane(robot, bend, bend.scaled(0.0)), hz, periodic=True)


def period_ticks(name: str, frequency: float, hz: int) -> int:
    """Return the ticks of one period, or raise an error unless they are a whole number."""
    if not (np.isfinite(frequency) and 0 < frequency <= hz / 10):
        raise InvalidValueError(name, frequency, f"a positive number of Hz up to {hz / 10:g}")
    ticks = table_ticks(name, frequency, 1.0 / frequency, hz)
    if abs(ticks * frequency / hz - 1.0) > 1e-9:
        raise InvalidValueError(name, frequency, f"a divisor of {hz} Hz, the ticks per second")
    return ticks


def _squats_and_bows(robot: Robot, time: np.ndarray, pace: float) -> tuple[Curve, Curve, Curve]:
    """Knee angle at the tops, squats of 1 rad, and pitch of the trunk; times (T,) s.

    The robot's legs extend as far as they can, `pace` times as fast as the biped's at speed 1.
    """
    least = least_bend(legs_of(robot))
    extension = rise(time, *(moment / pace for moment in _EXTENSION))
    tops = extension.scaled(least - max(_KNEE, least), max(_KNEE, least))
    squats = cosine(time, _SQUAT_HZ * pace).scaled(-0.5, 0.5)
    pitch = cosine(time, _BOW_HZ * pace).scaled(-_BOW_DEPTH / 2, _BOW_DEPTH / 2)
    return tops, squats, pitch


def _on_flat_feet(robot: Robot, joints: Curve, hz: int, *, periodic: bool) -> MotionTable:
    rows = seen_from_feet(robot, base_on_feet(robot, joints, home_points(robot)))
    places, points = rows.com[:, :2], Stance.of(robot).layout
    refuse_beyond(robot, min(margin_within(points, places[row]) for row in convex_hull(places)))
    return MotionTable(robot, rows, hz, periodic)
