"""The joints that place a robot's feet, and hips, knees and ankles of two legs."""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError, RobotError
from fbid_gym.motions.curves import Curve
from fbid_gym.motions.kinematics import base_on_feet, home_points, seen_from_feet
from fbid_gym.robots import Robot
from fbid_gym.robots.measured import once_for_robot

_PITCHES = 0.94  # cosine of 20 degrees: how nearly an axis points to the side
_STEP = 1e-4  # rad
_ROUNDS = 8
_OVER = 1e-9  # m


class PitchLegs(NamedTuple):
    """The joints of two legs that bend in the sagittal plane; the first leg is the left one."""

    foot: np.ndarray  # (2,) int, the foot of each leg
    # (2, 6) int, of each leg, from the base to the foot: those that place its sole.
    joints: np.ndarray
    # (2, 3) int, hip, knee and ankle of each: those that turn about the axis to the side.
    pitch: np.ndarray
    # (2, 3), +1 where a joint's angle grows as what it carries pitches forward, else -1.
    sign: np.ndarray
    home: np.ndarray  # (2, 3) rad, their angles at home
    bend: float  # rad, how far the knees are bent at home; 0 is a straight leg
    forward: float  # +1 where the knees point ahead, as a human's, -1 where they point back
    range: np.ndarray  # (2, 2, 3) rad, least and largest angles


def legs_of(robot: Robot) -> PitchLegs:
    """Find the joints of a robot's two legs.

    Raises:
        RobotError: it has not two legs on soles that six joints can place, three of which pitch.
    """
    stance = Stance.of(robot)
    terms, moves = stance.terms, stance.legs
    feet = f"Robot {robot.name!r} has {robot.num_feet} feet: {', '.join(robot.foot_names)}."
    if robot.num_feet != 2 or not robot.has_soles:
        raise RobotError(f"{feet} Expected two, left and right, with soles.")
    left = np.array([0.0, 1.0, 0.0])
    order = np.argsort(-terms.foot_position[0] @ left)
    joints, pitch, sign, bend, forward = [], [], [], [], []
    for foot in order:
        own = np.flatnonzero(moves[foot])
        along = terms.foot_jacobian[0, foot, 3:, 6 + own] @ left  # of the axes
        pitching = own[np.abs(along) > _PITCHES]
        if len(own) < 6 or len(pitching) != 3:
            raise RobotError(
                f"Leg {robot.foot_names[foot]!r} of robot {robot.name!r} has {len(own)} joints: "
                f"{_named(robot, own)}; about the axis to the side: {_named(robot, pitching)}. "
                "Expected at least six, three of them about that axis: hip, knee, ankle."
            )
        bent = _bend(terms.foot_jacobian[0, foot][:, 6 + pitching], left)
        joints.append(placing(own, terms.foot_jacobian[0, foot], stance.length))
        pitch.append(pitching)
        sign.append(np.sign(along[np.abs(along) > _PITCHES]))
        forward.append(1.0 if bent >= 0.0 else -1.0)
        bend.append(abs(bent))
    if forward[0] != forward[1] or abs(bend[0] - bend[1]) > 1e-6:
        raise RobotError(
            f"The legs of robot {robot.name!r} are bent by {forward[0] * bend[0]:.3g} and "
            f"{forward[1] * bend[1]:.3g} rad at home. Expected both alike."
        )
    columns, signs = np.array(pitch), np.array(sign)
    home, limits = robot.home_qpos[7:][columns], np.moveaxis(robot.joint_range[columns], -1, 0)
    return PitchLegs(order, np.array(joints), columns, signs, home, bend[0], forward[0], limits)


def placing(joints: np.ndarray, jacobian: np.ndarray, length: float) -> np.ndarray:
    """Return those joints that place a foot best: their Jacobian has the largest determinant.

    The joints to choose from are at least as many as the coordinates: the Jacobian is (3, nv) of a
    point, or (6, nv) of a sole, its rotation last. The length (m) counts as much as a radian.
    """
    count = len(jacobian)
    scaled = jacobian / np.repeat([length, 1.0], 3)[:count, None]
    some = list(combinations(joints, count))
    sizes = [abs(np.linalg.det(scaled[:, 6 + np.array(those)])) for those in some]
    return np.array(some[int(np.argmax(sizes))])


def least_bend(legs: PitchLegs) -> float:
    """Return how little the knees can bend, rad: 0 where the legs can be straight."""
    knees = legs.forward * legs.sign[:, 1]
    stop = np.where(knees > 0, legs.range[0, :, 1], -legs.range[1, :, 1])
    least = stop - knees * legs.home[:, 1] + legs.bend
    return max(0.0, float(least.max()))


def bent(robot: Robot, legs: PitchLegs, knee: Curve, ankle: Curve, pitch: Curve) -> Curve:
    """Return the joint motion, (T, n) rad, of bent legs on level soles, all other joints at home.

    Both legs do the same: (T,) rad say how far the knees are bent, 0 where straight, and how far
    the shanks lean back and the trunk pitches forward from where they are at home.
    """
    knee = knee.scaled(legs.forward, -legs.forward * legs.bend)
    hip = knee.plus(ankle, pitch).scaled(-1.0)
    size = len(knee.value)
    still = np.zeros((size, robot.num_joints))
    joints = Curve(np.tile(robot.home_qpos[7:], (size, 1)), still.copy(), still.copy())
    for whole, *parts in zip(joints, hip, knee, ankle, strict=True):
        for columns, sign in zip(legs.pitch, legs.sign, strict=True):
            whole[:, columns] += sign * np.stack(parts, axis=1)
    return joints


def _bend(jacobian: np.ndarray, left: np.ndarray) -> float:
    """Angle from thigh to shank about the axis to the left (3,), rad.

    The Jacobian (6, 3) is that of the foot for hip, knee and ankle.
    """
    axes = jacobian[3:].T
    from_foot = -np.cross(jacobian[:3].T, axes)  # across each axis, of the point on it
    hip, knee, ankle = from_foot - (from_foot @ left)[:, None] * left
    thigh, shank = knee - hip, ankle - knee
    return float(np.arctan2(np.cross(thigh, shank) @ left, thigh @ shank))


def _named(robot: Robot, joints: np.ndarray) -> str:
    return ", ".join(robot.joint_names[joint] for joint in joints) or "(none)"


@once_for_robot
def lean_of(robot: Robot) -> tuple[float, float, float]:
    """Return how far the shanks lean back to bring the centre of mass over the middle of the soles.

    Three numbers: rad from where they are at home, rad for each rad that the knees are bent, and
    rad for each rad that the trunk pitches forward. Least squares over knees of 0 to 1.6 rad and
    pitches of 0 to 0.8 rad; the built-in biped's centre of mass is then 8 mm away at most.

    Raises:
        RobotError: it has not two legs that bend.
        InvalidValueError: its feet cannot stay where they are while both legs bend alike.
    """
    legs = legs_of(robot)
    grids = np.meshgrid(np.linspace(0.0, 1.6, 17), np.linspace(0.0, 0.8, 9))  # rad
    knee, pitch = (grid.ravel() for grid in grids)
    ankle = np.zeros(len(knee))
    for _ in range(_ROUNDS):
        ahead = _ahead(robot, legs, knee, ankle, pitch)
        slope = (_ahead(robot, legs, knee, ankle + _STEP, pitch) - ahead) / _STEP
        ankle = ankle - ahead / slope
    plane = np.stack([np.ones(len(knee)), knee, pitch], axis=1)
    offset, per_knee, per_pitch = np.linalg.lstsq(plane, ankle, rcond=None)[0].tolist()
    return offset, per_knee, per_pitch


def legs_in_plane(robot: Robot, knee: Curve, pitch: Curve) -> Curve:
    """Return the joint motion of a squat, (T, n) rad, both legs alike, all other joints at home.

    The knees are bent by (T,) rad, and the trunk pitches by (T,) rad from where it is at home.

    Raises:
        RobotError: the robot has not two legs that bend.
    """
    offset, per_knee, per_pitch = lean_of(robot)
    ankle = knee.scaled(per_knee, offset).plus(pitch.scaled(per_pitch))
    return bent(robot, legs_of(robot), knee, ankle, pitch)


def refuse_beyond(robot: Robot, margin: float) -> None:
    """Raise an `InvalidValueError` if a motion's least margin within the feet, m, is negative."""
    if margin < -_OVER:
        raise InvalidValueError(
            f"motion of robot {robot.name!r}",
            f"centre of mass {-margin:.2g} m beyond its feet",
            "one above its feet",
        )


def _ahead(
    robot: Robot, legs: PitchLegs, knee: np.ndarray, ankle: np.ndarray, pitch: np.ndarray
) -> np.ndarray:
    """Find how far the centre of mass is ahead of the soles' centre in K postures, (K,) m."""
    postures = bent(
        robot, legs, *(Curve(angle, 0 * angle, 0 * angle) for angle in (knee, ankle, pitch))
    )
    states = base_on_feet(robot, postures, home_points(robot))
    return seen_from_feet(robot, states).com[:, 0]
