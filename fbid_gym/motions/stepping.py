"""Stepping in place: a squat, a sway from foot to foot and feet that lift, [M10] IV.D."""

from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.curves import Curve, cosine, rise
from fbid_gym.motions.kinematics import base_on_feet, home_points, joints_on_feet, seen_from_feet
from fbid_gym.motions.legs import legs_in_plane, legs_of
from fbid_gym.motions.squat import BIPED_FALLING_RATE, period_ticks
from fbid_gym.motions.table import MotionTable
from fbid_gym.robots import Robot

_WIDTH = 0.18  # m, between the feet of the built-in biped


class Steps(NamedTuple):
    """Numbers of a stepping motion.

    Attributes:
        period: s, one step of either foot. The paper's.
        squat_frequency: Hz. The paper's; a whole number of squats shall fit the period.
        knee: rad, mean of how far the knees are bent.
        amplitude: rad, of the squat at the knee.
        sway: m, amplitude of the base's way sideways, a sinusoid.
        single: share of the period that each foot is in the air.
        lift: (3,) rad added to hip, knee and ankle pitch of the leg in the air; of knees that point
            back, taken away.
        ramp: s it takes to add them and to take them away, within the time in the air; 0 for
            instant changes as in the paper. With 0.25 the feet come down where they rose; instant
            changes move them by a few centimetres per step, since a hip is slower than a knee.
        spread: m, by how much each foot stands farther out than at home.
    """

    period: float = 3.0
    squat_frequency: float = 2.0
    knee: float = 0.6
    amplitude: float = 0.1
    sway: float = 0.085
    single: float = 0.25
    lift: tuple[float, float, float] = (-0.12, 0.24, -0.12)
    ramp: float = 0.0
    spread: float = 0.0


PAPER = Steps()
"""The numbers of [M10] IV.D where the paper gives them."""


def steps_for(
    robot: Robot, hz: int, *, period: float | None = None, ramp: float | None = None
) -> Steps:
    """Return the paper's numbers on a robot of another size than the built-in biped.

    The sway scales with the distance between the feet, and time with how fast the robot falls.

    Args:
        robot: one on two soles.
        hz: ticks per second; the period is a whole number of ticks.
        period: s, instead.
        ramp: s, that a foot takes to rise and to come down. None: a twelfth of the period.

    Raises:
        RobotError: the robot has not two legs that bend.
    """
    left, right = Stance.of(robot).terms.foot_position[0, legs_of(robot).foot, :2]
    squats = round(PAPER.period * PAPER.squat_frequency)
    if period is None:
        slow = BIPED_FALLING_RATE / Stance.of(robot).falling_rate
        period = round(slow * PAPER.period * hz) / hz
    else:
        squats = max(1, round(squats * period / PAPER.period))
    return PAPER._replace(
        period=period,
        squat_frequency=squats / period,
        sway=PAPER.sway * float(np.linalg.norm(left - right)) / _WIDTH,
        ramp=period / 12 if ramp is None else ramp,
    )


def stepping(robot: Robot, steps: Steps = PAPER, *, hz: int = 500) -> MotionTable:
    """Squat while stepping in place, [M10] IV.D, figures 8-9.

    It begins in double support with the base between the feet, on its way to the right foot; the
    left foot lifts around a quarter of the period and the right foot around three quarters.

    Args:
        robot: one on two soles, with hips, knees and ankles that pitch.
        steps: its numbers.
        hz: ticks per second.

    Raises:
        RobotError: the robot has no such legs.
        InvalidValueError: a number is not valid, a foot cannot be where it shall be, or the motion
            leaves a joint's range.
    """
    ticks = _check(steps, hz)
    time = np.arange(ticks) / hz
    bend = cosine(time, steps.squat_frequency).scaled(-steps.amplitude, steps.knee)
    in_plane = legs_in_plane(robot, bend, bend.scaled(0.0))
    points = home_points(robot)
    base = base_on_feet(robot, in_plane, points)
    sway = cosine(time, 1.0 / steps.period, np.pi / 2).scaled(steps.sway)
    for whole, part in zip(base, sway, strict=True):
        whole[:, 1] += part

    sizes = [foot.num_points for foot in robot.feet]
    # The base stays where it is over feet at home: the legs stretch a little to reach farther out.
    outwards = steps.spread * np.sign(_centres(points, sizes)[:, 1])
    points = points + np.repeat(outwards, sizes)[:, None] * [0.0, 1.0, 0.0]
    centres = _centres(points, sizes)
    still = np.zeros((ticks, *centres.shape))
    place = Curve(still + centres, still, still)
    legs = legs_of(robot)
    standing = np.ones((ticks, robot.num_feet), bool)
    states = joints_on_feet(
        robot, base, lambda *_: place, standing, legs.joints.ravel().tolist(), in_plane.value
    )

    joints = Curve(*(part[:, -robot.num_joints :].copy() for part in states))
    planted, jumps = standing.copy(), np.zeros(ticks, bool)
    for leg, middle in enumerate((0.25, 0.75)):
        # First tick in the air and first tick on the ground again.
        ends = (middle - 0.5 * steps.single, middle + 0.5 * steps.single)
        first, last = (round(end * (steps.period * hz)) for end in ends)
        planted[first:last, legs.foot[leg]] = False
        if steps.ramp == 0.0:
            jumps[[first, last % ticks]] = True
        columns, lift = legs.pitch[leg], legs.forward * legs.sign[leg] * steps.lift
        for whole, part in zip(joints, _lifted(steps, time, first, last, hz), strict=True):
            whole[:, columns] += part[:, None] * lift
    states = base_on_feet(robot, joints, points, planted)
    return MotionTable(
        robot, seen_from_feet(robot, states, planted), hz, periodic=True, jumps=jumps
    )


def _centres(points: np.ndarray, sizes: list[int]) -> np.ndarray:
    """Return the centre of each foot's points, (F, 3)."""
    return np.array([part.mean(axis=0) for part in np.split(points, np.cumsum(sizes)[:-1])])


def _lifted(steps: Steps, time: np.ndarray, first: int, last: int, hz: int) -> Curve:
    """Share of the lift, (T,): 0 on the ground, 1 in the air."""
    if steps.ramp == 0.0:
        ticks = np.arange(len(time))
        inside = ((first <= ticks) & (ticks < last)).astype(float)
        return Curve(inside, 0 * inside, 0 * inside)
    start, end = first / hz, last / hz
    up, down = rise(time, start, start + steps.ramp), rise(time, end - steps.ramp, end)
    return up.plus(down.scaled(-1.0))


def _check(steps: Steps, hz: int) -> int:
    """Return the ticks of one period, or raise an error that names the number at fault."""
    if not (np.isfinite(steps.period) and steps.period > 0):
        raise InvalidValueError("period", steps.period, "a positive number of seconds")
    ticks = period_ticks("stepping frequency", 1.0 / steps.period, hz)
    squats = steps.squat_frequency * steps.period
    if not (steps.squat_frequency > 0 and abs(squats - round(squats)) < 1e-9):
        raise InvalidValueError(
            "squat_frequency",
            steps.squat_frequency,
            f"a whole number of squats in the period of {steps.period:g} s",
        )
    if not 0 < steps.single < 0.5:
        raise InvalidValueError("single", steps.single, "a share of the period between 0 and 0.5")
    if not 0 <= steps.ramp <= 0.5 * steps.single * steps.period:
        raise InvalidValueError(
            "ramp",
            steps.ramp,
            f"seconds between 0 and half the time in the air, "
            f"{0.5 * steps.single * steps.period:g}",
        )
    return ticks
