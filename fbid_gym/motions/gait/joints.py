"""Joint motions of a gait, by inverse kinematics: for layers that track joints.

The body is taken to move as the gait wants it, at its height, upright and in its heading, and each
foot to be where its target is. One damped Newton step from the joints' present angles finds those
that fit, and the same Jacobians the rates. Joints of no leg stay at home.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import RobotError
from fbid_gym.motions.gait.target import GaitTarget
from fbid_gym.quantities import DynamicsTerms, Reference, RobotState, SupportFrame
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import factor, solve_factored

_DAMPING = 1e-4  # of the mean squared gain of a leg, near a stretched knee
_LONGEST = 0.3  # rad, of a step


class Legs(NamedTuple):
    """Which joints move which foot; constants of a robot.

    Attributes:
        joints: (F, n) bool, of this foot and no other.
        rows: coordinates of a foot that its joints can place: 3 of a point, 6 of a sole.
        home: (nq,) of the robot.
        low: (n,) rad and
        high: (n,) rad, ends of the joints' ranges.
        upright: (3, 3) of the base at home, its heading zero.
    """

    joints: np.ndarray
    rows: int
    home: np.ndarray
    low: np.ndarray
    high: np.ndarray
    upright: np.ndarray


def legs_of(robot: Robot) -> Legs:
    """Return the legs of a robot.

    Raises:
        RobotError: a foot has no joints of its own to place it.
    """
    stance = Stance.of(robot)
    for foot, own in zip(robot.foot_names, stance.legs, strict=True):
        if own.sum() < 3:
            raise RobotError(
                f"Foot {foot!r} of {robot.name!r} hangs from {own.sum()} joints of its own. "
                "Expected at least three to follow a gait with the joints."
            )
    low, high = robot.joint_range.T
    return Legs(
        joints=stance.legs,
        rows=6 if robot.num_points > robot.num_feet else 3,
        home=robot.home_qpos,
        low=np.ascontiguousarray(low),
        high=np.ascontiguousarray(high),
        upright=stance.home_base_rotation.copy(),
    )


@kernel
def joint_reference(
    legs: Legs,
    target: GaitTarget,
    state: RobotState,
    terms: DynamicsTerms,
    frame: SupportFrame,
) -> Reference:
    """Return what the joints shall do for a gait, with the body's motion for that of the base.

    The reference's base and centre of mass are those of now, with the accelerations that the gait
    wants: layers that balance by themselves add no spring of their own to it.
    """
    count, size = state.qvel.shape
    joints, feet, rows = size - 6, len(legs.joints), legs.rows
    qpos, qvel, qacc = state.qpos.copy(), np.zeros((count, size)), np.zeros((count, size))
    com, com_velocity = np.zeros((count, 3)), np.zeros((count, 3))
    com_acceleration = np.zeros((count, 3))
    body, lag = np.zeros(6), np.zeros(6)
    gap, rate, jacobian = np.empty(rows), np.empty(rows), np.empty((rows, joints))
    for i in range(count):
        qpos[i, 7:] = legs.home[7:]
        for k in range(3):
            for axis in range(3):
                share = frame.world_from_support[i, axis, k]
                com[i, k] += share * (terms.com[i, axis] - frame.centre[i, axis])
                com_velocity[i, k] += share * terms.com_velocity[i, axis]
                if axis < 2:
                    com_acceleration[i, k] += share * target.com_acceleration[i, axis]
        # How the base is to move, and by how much it is off: height and rotation.
        body[:], lag[:] = 0.0, 0.0
        body[0], body[1] = target.velocity[i, 0], target.velocity[i, 1]
        lag[2] = target.height[i] - terms.base_position[i, 2]
        _turn_left(target.heading[i], terms.world_from_base[i], lag)
        for k in range(3):
            body[3 + k] = terms.world_from_base[i, 2, k] * target.turning[i]
        for foot in range(feet):
            for r in range(rows):
                gap[r] = 0.0
                if r < 3:
                    here = terms.foot_position[i, foot, r]
                    gap[r] = target.foot_position[i, foot, r] - here
                rate[r] = target.foot_velocity[i, foot, r]
                for k in range(6):
                    share = terms.foot_jacobian[i, foot, r, k]
                    gap[r] -= share * lag[k]
                    rate[r] -= share * body[k]
                for j in range(joints):
                    own = legs.joints[foot, j]
                    jacobian[r, j] = terms.foot_jacobian[i, foot, r, 6 + j] if own else 0.0
            if rows == 6:
                _add_rotation(target.world_from_foot[i, foot], terms.world_from_foot[i, foot], gap)
            _solve_leg(jacobian, gap, rate)
            for j in range(joints):
                if legs.joints[foot, j]:
                    change = 0.0
                    for r in range(rows):
                        change += jacobian[r, j] * gap[r]
                        qvel[i, 6 + j] += jacobian[r, j] * rate[r]
                    change = min(max(change, -_LONGEST), _LONGEST)
                    angle = state.qpos[i, 7 + j] + change
                    qpos[i, 7 + j] = min(max(angle, legs.low[j]), legs.high[j])
    planted = target.planted.copy()
    return Reference(qpos, qvel, qacc, com, com_velocity, com_acceleration, planted, True)


@compiled
def _turn_left(heading: float, rotation: np.ndarray, lag: np.ndarray) -> None:
    """Write the rotation that is left to upright and a heading, base axes, to lag[3:]."""
    cosine, sine = np.cos(heading), np.sin(heading)
    e10 = rotation[0, 1] * cosine + rotation[1, 1] * sine
    e20 = rotation[0, 2] * cosine + rotation[1, 2] * sine
    e01 = rotation[1, 0] * cosine - rotation[0, 0] * sine
    e21 = rotation[1, 2] * cosine - rotation[0, 2] * sine
    lag[3] = 0.5 * (e21 - rotation[2, 1])
    lag[4] = 0.5 * (rotation[2, 0] - e20)
    lag[5] = 0.5 * (e10 - e01)


@compiled
def _add_rotation(target: np.ndarray, now: np.ndarray, gap: np.ndarray) -> None:
    """Add axis times sine of the rotation from `now` to `target`, world axes, to gap[3:]."""
    for k in range(3):
        gap[3] += 0.5 * (now[1, k] * target[2, k] - now[2, k] * target[1, k])
        gap[4] += 0.5 * (now[2, k] * target[0, k] - now[0, k] * target[2, k])
        gap[5] += 0.5 * (now[0, k] * target[1, k] - now[1, k] * target[0, k])


@compiled
def _solve_leg(jacobian: np.ndarray, gap: np.ndarray, rate: np.ndarray) -> None:
    """Overwrite gap and rate (r,) with what J^T (…) makes joint changes and rates of; damped."""
    rows = len(jacobian)
    lower, trace = np.empty((rows, rows)), 0.0
    for a in range(rows):
        for b in range(a + 1):
            total = 0.0
            for j in range(jacobian.shape[1]):
                total += jacobian[a, j] * jacobian[b, j]
            lower[a, b] = total
        trace += lower[a, a]
    for a in range(rows):
        lower[a, a] += _DAMPING * trace / rows
    factor(lower)
    solve_factored(lower, gap)
    solve_factored(lower, rate)
