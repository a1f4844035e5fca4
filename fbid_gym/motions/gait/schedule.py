"""The clock of a gait on four feet: times at which they leave the ground and come back.

All feet step once in a cycle, whose phase goes from 0 to 1, and stand for the same share of it, the
duty factor. Gaits differ by the time at which each foot lifts.
"""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.checks import check_choices
from fbid_gym.compiled import compiled
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import RobotError
from fbid_gym.robots import Robot


class Schedule(NamedTuple):
    """Swing times of each foot; F feet."""

    period: float  # s, of a cycle
    duty: float  # share of the cycle that each foot stands, in (0, 1]; 1: it never lifts
    lift: np.ndarray  # (F,) phase at which each foot lifts, in [0, 1)


class FootPattern(NamedTuple):
    """A gait of four feet, whatever the robot's size."""

    period: float  # of a cycle, in units of sqrt(h / g), in which a robot that is h tall falls
    duty: float  # share of the cycle that each foot stands
    # Phases at which the front left, front right, hind left and hind right foot lift.
    lift: tuple[float, float, float, float]
    capture: float = 1.0  # share of an error of velocity that one step takes away
    clearance: float = 0.25  # of h that a foot is lifted above the higher end of its step
    unload: float = 0.14  # sqrt(h / g) in which a foot gives up its load, or takes it


PATTERNS = {
    "trot": FootPattern(2.5, 0.55, (0.0, 0.5, 0.5, 0.0)),
    "short_trot": FootPattern(1.8, 0.55, (0.0, 0.5, 0.5, 0.0), 0.8, 0.15, 0.08),
    "walk": FootPattern(4.0, 0.78, (0.25, 0.75, 0.0, 0.5)),
    "pace": FootPattern(1.7, 0.6, (0.0, 0.5, 0.0, 0.5)),
    "bound": FootPattern(1.8, 0.7, (0.0, 0.0, 0.5, 0.5)),
    "stand": FootPattern(2.9, 1.0, (0.0, 0.0, 0.0, 0.0)),
}
"""Diagonal pairs, by long steps and by short and low ones; one foot after the other, each hind foot
before the front foot of its side; pairs of one side; front and hind pairs; none. The short trot
keeps more robots up on slippery ground and under pushes, see docs/v1.md."""


def schedule_of(robot: Robot, gait: str = "trot", period: float | None = None) -> Schedule:
    """Return the schedule of a gait on a robot's four feet, found by where they stand at home.

    A cycle takes a `period`, in units of sqrt(h / g), or that of the pattern.

    Raises:
        UnknownOptionError: a gait that is none of `PATTERNS`.
        RobotError: the robot has not one foot at each corner.
    """
    check_choices("gait", [gait], PATTERNS)
    pattern, stance = PATTERNS[gait], Stance.of(robot)
    time = math.sqrt(stance.home_com[2] / robot.gravity)
    lift = np.array(pattern.lift)[corners_of(robot)]
    return Schedule((period or pattern.period) * time, pattern.duty, lift)


def corners_of(robot: Robot) -> np.ndarray:
    """Return the place of each foot among front left, front right, hind left, hind right: (F,).

    Raises:
        RobotError: the robot has not one foot at each corner.
    """
    stance = Stance.of(robot)
    feet = stance.terms.foot_position[0]
    ahead, left, _ = (feet - feet.mean(axis=0)).T
    corners = 2 * (ahead < 0.0) + (left < 0.0)
    if sorted(corners) != [0, 1, 2, 3]:
        raise RobotError(
            f"Robot {robot.name!r} has {robot.num_feet} feet: {', '.join(robot.foot_names)}. "
            "Expected four to walk on, one at each corner: front left, front right, hind left, "
            "hind right."
        )
    return corners


@compiled
def since_lift(schedule: Schedule, phase: float, foot: int) -> float:
    """Return the share of the cycle since a foot was last due to lift, in [0, 1)."""
    share = phase - schedule.lift[foot]
    return share - math.floor(share)
