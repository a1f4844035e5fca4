"""Bent legs under a centre of mass that stays over the soles."""

from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.curves import Curve
from fbid_gym.motions.kinematics import base_on_feet, home_points, seen_from_feet
from fbid_gym.motions.legs import Legs, bent, legs_of
from fbid_gym.quantities import Target
from fbid_gym.robots import Robot
from fbid_gym.robots.measured import once_for_robot
from fbid_gym.robots.polygon import convex_hull, margin_within

_KNEES, _PITCHES = np.linspace(0.0, 1.6, 17), np.linspace(0.0, 0.8, 9)  # rad
_STEP = 1e-4  # rad
_ROUNDS = 8
_OVER = 1e-9  # m


class Lean(NamedTuple):
    """How far the shanks lean back from where they are at home: a plane over knee and pitch."""

    offset: float  # rad
    per_knee: float  # rad for each rad that the knees are bent
    per_pitch: float  # rad for each rad that the trunk pitches forward


@once_for_robot
def lean_of(robot: Robot) -> Lean:
    """Return the lean that comes nearest to a centre of mass over the centre of the soles.

    Least squares over knees of 0 to 1.6 rad and pitches of 0 to 0.8 rad. The built-in biped's is
    then 8 mm away at most.

    Raises:
        RobotError: it has not two legs that bend.
        InvalidValueError: its feet cannot stay where they are while both legs bend alike.
    """
    legs = legs_of(robot)
    knee, pitch = (grid.ravel() for grid in np.meshgrid(_KNEES, _PITCHES))
    ankle = np.zeros(len(knee))
    for _ in range(_ROUNDS):
        ahead = _ahead(robot, legs, knee, ankle, pitch)
        slope = (_ahead(robot, legs, knee, ankle + _STEP, pitch) - ahead) / _STEP
        ankle = ankle - ahead / slope
    plane = np.stack([np.ones(len(knee)), knee, pitch], axis=1)
    return Lean(*np.linalg.lstsq(plane, ankle, rcond=None)[0].tolist())


def legs_in_plane(robot: Robot, knee: Curve, pitch: Curve) -> Curve:
    """Return the joint motion of a squat, the same on both legs, all other joints at home.

    Args:
        robot: one on two legs.
        knee: (T,) rad, how far the knees are bent.
        pitch: (T,) rad, pitch of the trunk from where it is at home.

    Returns:
        (T, n) rad.

    Raises:
        RobotError: the robot has not two legs that bend.
    """
    lean = lean_of(robot)
    ankle = knee.scaled(lean.per_knee, lean.offset).plus(pitch.scaled(lean.per_pitch))
    return bent(robot, legs_of(robot), knee, ankle, pitch)


def check_over_feet(robot: Robot, rows: Target) -> None:
    """Check that the centre of mass stays above the hull of the feet.

    Raises:
        InvalidValueError: it does not.
    """
    places, points = rows.com[:, :2], Stance.of(robot).layout
    refuse_beyond(robot, min(margin_within(points, places[row]) for row in convex_hull(places)))


def refuse_beyond(robot: Robot, margin: float) -> None:
    """Raise an `InvalidValueError` if a motion's least margin within the feet, m, is negative."""
    if margin < -_OVER:
        raise InvalidValueError(
            f"motion of robot {robot.name!r}",
            f"centre of mass {-margin:.2g} m beyond its feet",
            "one above its feet",
        )


def _ahead(
    robot: Robot, legs: Legs, knee: np.ndarray, ankle: np.ndarray, pitch: np.ndarray
) -> np.ndarray:
    """How far the centre of mass is ahead of the centre of the soles in K postures, (K,) m."""
    postures = bent(
        robot, legs, *(Curve(angle, 0 * angle, 0 * angle) for angle in (knee, ankle, pitch))
    )
    states = base_on_feet(robot, postures, home_points(robot))
    return seen_from_feet(robot, states).com[:, 0]
