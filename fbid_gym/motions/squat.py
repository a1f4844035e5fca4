"""Squats of the biped with flat feet, [M10] IV.B and IV.C: sinusoids at hip, knee and ankle.

The paper shows plots and no formulas. Here knee and trunk pitch are sinusoids, and the ankle is
linear in both, so that all three joint angles are combined sinusoids and the centre of mass stays
over the soles:

    ankle = LEAN + LEAN_PER_KNEE knee + LEAN_PER_PITCH pitch,   hip = -knee - ankle - pitch

The second equation keeps the soles flat, so the feet stay where they are whatever the sinusoids.
"""

from collections.abc import Sequence

import numpy as np

from fbid_gym.errors import InvalidValueError, RobotError
from fbid_gym.motions.curves import Curve, cosine, rise
from fbid_gym.motions.kinematics import base_on_feet, home_points, seen_from_feet
from fbid_gym.motions.table import MotionTable, table_ticks
from fbid_gym.robots import Robot

LEAN, LEAN_PER_KNEE, LEAN_PER_PITCH = -0.0578, -0.4070, 0.1153
"""Ankle angle in rad and its shares in knee angle and trunk pitch.

Least squares over knees of 0 to 1.6 rad and pitches of 0 to 0.8 rad to the ankle that puts the
built-in biped's centre of mass over the centre of its soles. It is then 8 mm away at most.
"""

SECONDS = 30.0
"""Length of the squat/bow at speed 1, s."""

_SQUAT_HZ, _BOW_HZ = 0.2, 0.1
# Deep enough that at 5 times the speed joint feedback alone falls for nearly all gains; the centre
# of pressure then comes within 3 cm of the tips of the soles, and the ground carries 0.6 to 1.7 of
# the weight.
_KNEE, _SQUAT_DEPTH, _BOW_DEPTH = 0.45, 1.4, 0.6  # rad
_EXTENSION = (5.0, 20.0)  # s


def squat_bow(robot: Robot, *, speed: float = 1.0, hz: int = 500) -> MotionTable:
    """Squat and bow in the sagittal plane while the knees extend fully, [M10] IV.B, figures 3-5.

    At speed 1 a squat of 1.4 rad at the knee every 5 s is combined with a bow of the trunk of
    0.6 rad every 10 s. The knee angle at the top of the squats is 0.45 rad in the first 5 s and
    falls to 0, its limit, at 20 s; the tops at 20, 25 and 30 s are at full extension, the second of
    them in a bow. The motion starts and ends at rest.

    Args:
        robot: the biped, or one with joints of the same names.
        speed: how many times faster than that; [M10] figure 5 shows 5.
        hz: ticks per second.

    Raises:
        RobotError: the robot lacks a joint of the motion.
        InvalidValueError: `speed` is not positive and finite, or the motion leaves a joint's range.
    """
    if not (np.isfinite(speed) and speed > 0):
        raise InvalidValueError("speed", speed, "a positive, finite number")
    ticks = table_ticks("speed", speed, SECONDS / speed, hz)
    time = np.arange(ticks + 1) / hz
    squat_hz, bow_hz = _SQUAT_HZ * speed, _BOW_HZ * speed
    extension = rise(time, *(moment / speed for moment in _EXTENSION))
    squats = cosine(time, squat_hz).scaled(-_SQUAT_DEPTH / 2, _SQUAT_DEPTH / 2)
    knee = extension.scaled(-_KNEE, _KNEE).plus(squats)
    pitch = cosine(time, bow_hz).scaled(-_BOW_DEPTH / 2, _BOW_DEPTH / 2)
    return _on_flat_feet(robot, legs_in_plane(robot, knee, pitch), hz, periodic=False)


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
        robot: the biped, or one with joints of the same names.
        frequency: Hz; a period shall be a whole number of ticks.
        knee: rad, mean knee angle.
        amplitude: rad, of the knee angle.
        hz: ticks per second.

    Raises:
        RobotError: the robot lacks a joint of the motion.
        InvalidValueError: a number is not valid, or the motion leaves a joint's range.
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


def legs_in_plane(robot: Robot, knee: Curve, pitch: Curve) -> Curve:
    """Return the joint motion of a squat, the same on both legs, all other joints at home.

    Args:
        robot: the biped.
        knee: (T,) rad, knee angle.
        pitch: (T,) rad, pitch of the trunk.

    Returns:
        (T, n) rad.
    """
    ankle = knee.scaled(LEAN_PER_KNEE, LEAN).plus(pitch.scaled(LEAN_PER_PITCH))
    hip = knee.plus(ankle, pitch).scaled(-1.0)
    shape = (len(knee.value), 1)
    joints = Curve(
        np.tile(robot.home_qpos[7:], shape),
        np.zeros((len(knee.value), robot.num_joints)),
        np.zeros((len(knee.value), robot.num_joints)),
    )
    for names, curve in (
        (("left_hip_pitch", "right_hip_pitch"), hip),
        (("left_knee", "right_knee"), knee),
        (("left_ankle_pitch", "right_ankle_pitch"), ankle),
    ):
        columns = joint_columns(robot, names)
        for whole, part in zip(joints, curve, strict=True):
            whole[:, columns] = part[:, None]
    return joints


def joint_columns(robot: Robot, names: Sequence[str]) -> list[int]:
    """Return which joints have these names.

    Raises:
        RobotError: the robot has no joint of a name.
    """
    for name in names:
        if name not in robot.joint_names:
            raise RobotError(
                f"The motion moves joint {name!r}, which robot {robot.name!r} does not have. "
                f"Its joints: {', '.join(robot.joint_names)}."
            )
    return [robot.joint_names.index(name) for name in names]


def _on_flat_feet(robot: Robot, joints: Curve, hz: int, *, periodic: bool) -> MotionTable:
    states = base_on_feet(robot, joints, home_points(robot))
    return MotionTable(robot, seen_from_feet(robot, states), hz, periodic)
