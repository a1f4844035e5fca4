"""Which joints of a robot place its feet, and which of two legs are hips, knees and ankles."""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import RobotError
from fbid_gym.motions.curves import Curve, stacked
from fbid_gym.robots import Robot

_PITCHES = 0.94  # cosine of 20 degrees: how nearly an axis points to the side


class Legs(NamedTuple):
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


def legs_of(robot: Robot) -> Legs:
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
    return Legs(order, np.array(joints), columns, signs, home, bend[0], forward[0], limits)


def placing(joints: np.ndarray, jacobian: np.ndarray, length: float) -> np.ndarray:
    """Return those joints that place a foot best: their Jacobian has the largest determinant.

    Args:
        joints: to choose from, at least as many as coordinates.
        jacobian: (3, nv) of a point, or (6, nv) of a sole, its rotation last.
        length: m, that counts as much as a radian.

    Returns:
        (3,) or (6,) int.
    """
    count = len(jacobian)
    scaled = jacobian / np.repeat([length, 1.0], 3)[:count, None]
    some = list(combinations(joints, count))
    sizes = [abs(np.linalg.det(scaled[:, 6 + np.array(those)])) for those in some]
    return np.array(some[int(np.argmax(sizes))])


def least_bend(legs: Legs) -> float:
    """Return how little the knees can bend, rad: 0 where the legs can be straight."""
    knees = legs.forward * legs.sign[:, 1]
    stop = np.where(knees > 0, legs.range[0, :, 1], -legs.range[1, :, 1])
    least = stop - knees * legs.home[:, 1] + legs.bend
    return max(0.0, float(least.max()))


def bent(robot: Robot, legs: Legs, knee: Curve, ankle: Curve, pitch: Curve) -> Curve:
    """Return the joint motion of bent legs on level soles, the same on both, the others at home.

    Args:
        robot: the robot.
        legs: its legs.
        knee: (T,) rad, how far the knees are bent, 0 where straight.
        ankle: (T,) rad, how far the shanks lean back from where they stand at home.
        pitch: (T,) rad, pitch of the trunk from where it is at home, positive forward.

    Returns:
        (T, n) rad.
    """
    knee = knee.scaled(legs.forward, -legs.forward * legs.bend)
    hip = knee.plus(ankle, pitch).scaled(-1.0)
    size = len(knee.value)
    still = np.zeros((size, robot.num_joints))
    joints = Curve(np.tile(robot.home_qpos[7:], (size, 1)), still.copy(), still.copy())
    for leg in range(2):
        turn = stacked([hip, knee, ankle])
        columns, sign = legs.pitch[leg], legs.sign[leg]
        for whole, part in zip(joints, turn, strict=True):
            whole[:, columns] += sign * part
    return joints


def _bend(jacobian: np.ndarray, left: np.ndarray) -> float:
    """Angle from thigh to shank about the axis to the side, rad.

    Args:
        jacobian: (6, 3) of the foot, for hip, knee and ankle.
        left: (3,) unit vector to the left.
    """
    axes = jacobian[3:].T
    from_foot = -np.cross(jacobian[:3].T, axes)  # across each axis, of the point on it
    hip, knee, ankle = from_foot - (from_foot @ left)[:, None] * left
    thigh, shank = knee - hip, ankle - knee
    return float(np.arctan2(np.cross(thigh, shank) @ left, thigh @ shank))


def _named(robot: Robot, joints: np.ndarray) -> str:
    return ", ".join(robot.joint_names[joint] for joint in joints) or "(none)"
