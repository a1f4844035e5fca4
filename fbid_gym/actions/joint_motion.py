"""The joint motion that layers follow which command joints: as planned, or by inverse kinematics.

Planned motions have it in their target. On a gait the body is taken to move as the target has it,
at its height, upright and in its heading, and each foot to be where its target is. One damped
Newton step from the joints' present angles finds those that fit, the same Jacobians the rates, and
the accelerations,

    qdd = J_q^+ (a_foot - Jdot v - J_base a_base).

Joints of no leg stay at home. Where no dynamics model answers errors of the base's velocity, feet
that stand do: for them the base is off by what it would lag behind if the error went on a while.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.rotations import rotation_at, turned_left
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.vectors import (
    Rotation,
    add,
    cross,
    dot,
    matrix,
    product,
    scale,
    store,
    transposed,
    turn,
    vector,
)
from fbid_gym.errors import RobotError
from fbid_gym.motions.gait.heading import share_within
from fbid_gym.motions.target import MotionKind
from fbid_gym.quantities import BodyGains, DynamicsTerms, RobotState, Target
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import copy, factor, gram, solve_factored

_DAMPING = 1e-4  # of a leg's mean squared gain in place, and in rotation, near a stretched knee
_LONGEST = 0.3  # rad, of a step
_LEAD = 2.0  # pendulum times
_FARTHEST = 0.06  # of the height; farther, robots that are pushed tip


@dataclass(frozen=True, eq=False)
class JointMotion:
    """Commanded motion of a robot's joints.

    Attributes:
        legs: which joints move which foot; None where the target says what joints do.
    """

    legs: "LegJoints | None"

    @classmethod
    def of(
        cls, robot: Robot, kind: MotionKind, gains: BodyGains, *, aware: bool, calm: float = 0.0
    ) -> "JointMotion":
        """Return the joint motion of a kind of motion.

        Args:
            robot: the robot.
            kind: of motion.
            gains: with which its body is balanced.
            aware: whether the feet in the air are led to their targets from the body as it moves,
                rather than as it shall move. That closes a loop through the base, which moves as
                the legs do: for layers that know its dynamics. Joint PD alone is less stable so.
            calm: s, for which errors of the base's velocities, the horizontal ones aside, count as
                errors of its height and its orientation, for feet that bear all they may: damping
                where joints can have little of their own.

        Raises:
            RobotError: on a gait, a foot has no joints of its own to place it.
        """
        return cls(legs_of(robot, gains, aware, calm) if kind.gait else None)

    def target(self, state: RobotState, target: Target, terms: DynamicsTerms) -> Target:
        """Return the target with what base and joints shall do for it."""
        if self.legs is None:
            return target
        return target._replace(**find_joints(self.legs, target, state, terms)._asdict())


class LegJoints(NamedTuple):
    """The joints that move each foot; constants of a robot."""

    own: np.ndarray  # (F, K) int, joints that move this foot and no other; -1 beyond the last
    rows: int  # coordinates of a foot that its joints can place: 3 of a point, 6 of a sole
    home: np.ndarray  # (nq,) of the robot
    low: np.ndarray  # (n,) rad, where the joints' ranges begin
    high: np.ndarray  # (n,) rad, where they end
    balance: float  # 1/s^2, of the centre of mass
    balance_damping: float  # 1/s, likewise
    aware: bool  # see `JointMotion.of`
    # s, for which an error of the base's velocity counts as one of its place, for feet that bear
    # all they may.
    lead: float
    farthest: float  # m, as which it counts at most
    calm: float  # s, see `JointMotion.of`


def legs_of(robot: Robot, gains: BodyGains, aware: bool, calm: float) -> LegJoints:
    """Return the legs of a robot; arguments as of `JointMotion.of`."""
    stance = Stance.of(robot)
    for foot, own in zip(robot.foot_names, stance.legs, strict=True):
        if own.sum() < 3:
            raise RobotError(
                f"Foot {foot!r} of {robot.name!r} hangs from {own.sum()} joints of its own. "
                "Expected at least three to place it by the joints."
            )
    low, high = robot.joint_range.T
    # Layers that know the dynamics answer errors of velocity by themselves. On soles the velocity
    # is to swing about that commanded, as a pendulum's does.
    lead = 0.0 if aware or robot.has_soles else _LEAD / stance.falling_rate
    own = np.full((robot.num_feet, stance.legs.sum(axis=1).max()), -1, np.int64)
    for row, leg in zip(own, stance.legs, strict=True):
        row[: leg.sum()] = np.flatnonzero(leg)
    return LegJoints(
        own=own,
        rows=6 if robot.has_soles else 3,
        home=robot.home_qpos,
        low=np.ascontiguousarray(low),
        high=np.ascontiguousarray(high),
        balance=gains.balance,
        balance_damping=gains.balance_damping,
        aware=aware,
        lead=lead,
        farthest=_FARTHEST * float(stance.home_com[2]),
        calm=calm,
    )


class WayLeft(NamedTuple):
    """Remaining displacement and its rate, of the base (6,) or of a foot's rows; buffers."""

    gap: np.ndarray  # m, rad
    rate: np.ndarray  # m/s, rad/s
    acceleration: np.ndarray  # m/s^2, rad/s^2


class JointTarget(NamedTuple):
    """The part of a `Target` that concerns base and joints."""

    qpos: np.ndarray
    qvel: np.ndarray
    qacc: np.ndarray

    @classmethod
    def of(cls, target: Target) -> "JointTarget":
        """Return it of a target that says so."""
        return cls(target.qpos, target.qvel, target.qacc)


@kernel
def find_joints(
    legs: LegJoints, target: Target, state: RobotState, terms: DynamicsTerms
) -> JointTarget:
    """Return what the joints shall do for a gait, with the body's motion for that of the base."""
    count, size = state.qvel.shape
    feet, most = legs.own.shape
    rows = legs.rows
    found = JointTarget(state.qpos.copy(), np.zeros((count, size)), np.zeros((count, size)))
    body = WayLeft(np.zeros(6), np.zeros(6), np.zeros(6))
    as_is = WayLeft(np.zeros(6), np.empty(6), body.acceleration)
    led = WayLeft(np.zeros(6), body.rate, body.acceleration)
    left = room_for(rows)
    jacobian, lower, moves = np.empty((rows, most)), np.empty((rows, rows)), room_for(most)
    for i in range(count):
        see_body(legs, target, terms, body, i)
        for k in range(6):
            as_is.rate[k] = state.qvel[i, k]
        for k in range(3):
            found.qacc[i, k] = body.acceleration[k]
        for k in range(7, size + 1):
            found.qpos[i, k] = legs.home[k]
        for foot in range(feet):
            own = legs.own[foot]
            for r in range(rows):
                for k in range(most):
                    there = own[k] >= 0
                    jacobian[r, k] = terms.foot_jacobian[i, foot, r, 6 + own[k]] if there else 0.0
            lead_foot(legs, body, as_is, target.load[i, foot], led)
            seen = as_is if legs.aware and not target.planted[i, foot] else led
            see_foot(target, terms, seen, left, i, foot)
            solve_leg(jacobian, lower, left, moves)
            for k in range(most):
                j = own[k]
                if j >= 0:
                    angle = state.qpos[i, 7 + j] + min(max(moves.gap[k], -_LONGEST), _LONGEST)
                    found.qpos[i, 7 + j] = min(max(angle, legs.low[j]), legs.high[j])
                    found.qvel[i, 6 + j] = moves.rate[k]
                    found.qacc[i, 6 + j] = moves.acceleration[k]
    return found


@compiled
def see_body(legs: LegJoints, target: Target, terms: DynamicsTerms, body: WayLeft, i: int) -> None:
    """Write how the base is off, and how it is to move."""
    for axis in range(2):
        body.gap[axis] = target.com[i, axis] - terms.com[i, axis]
        body.rate[axis] = target.com_velocity[i, axis]
        late = target.com_velocity[i, axis] - terms.com_velocity[i, axis]
        body.acceleration[axis] = target.com_acceleration[i, axis]
        body.acceleration[axis] += legs.balance * body.gap[axis] + legs.balance_damping * late
    body.gap[2] = target.qpos[i, 2] - terms.base_position[i, 2]
    upright, now = rotation_at(target.qpos, i, 3), matrix(terms.world_from_base, (i,))
    to_base = transposed(now)
    body.gap[3], body.gap[4], body.gap[5] = turn(to_base, turned_left(upright, now))
    spin = turn(upright, vector(target.qvel, (i,), 3))
    body.rate[3], body.rate[4], body.rate[5] = turn(to_base, spin)


@compiled
def lead_foot(legs: LegJoints, body: WayLeft, as_is: WayLeft, load: float, led: WayLeft) -> None:
    """Write how the base is off for a foot: with what it bears, also by the error of velocity.

    The joints' stiffness makes a force of it. Their damping would, too, but it also acts on a foot
    that has just lost the ground, which shakes if damped by more than sampling allows.
    """
    x = legs.lead * (body.rate[0] - as_is.rate[0])
    y = legs.lead * (body.rate[1] - as_is.rate[1])
    share = load * share_within(legs.farthest, x, y)
    copy(body.gap, led.gap)
    led.gap[0] += share * x
    led.gap[1] += share * y
    if legs.calm > 0.0:
        for k in range(2, 6):
            led.gap[k] += load * legs.calm * (body.rate[k] - as_is.rate[k])


@compiled
def see_foot(
    target: Target, terms: DynamicsTerms, body: WayLeft, left: WayLeft, i: int, foot: int
) -> None:
    """Write what of a foot's motion is left to its joints, beside that of the body."""
    rows = len(left.gap)
    for r in range(3):
        left.gap[r] = target.foot_position[i, foot, r] - terms.foot_position[i, foot, r]
    if rows == 6:
        left.gap[3], left.gap[4], left.gap[5] = turned_left(
            matrix(target.world_from_foot, (i, foot)), matrix(terms.world_from_foot, (i, foot))
        )
    for r in range(rows):
        gap, rate = left.gap[r], target.foot_velocity[i, foot, r]
        acceleration = target.foot_acceleration[i, foot, r] - terms.foot_bias[i, foot, r]
        for k in range(6):
            share = terms.foot_jacobian[i, foot, r, k]
            gap -= share * body.gap[k]
            rate -= share * body.rate[k]
            acceleration -= share * body.acceleration[k]
        left.gap[r], left.rate[r], left.acceleration[r] = gap, rate, acceleration


@compiled
def room_for(size: int) -> WayLeft:
    """Return a motion that is yet to be written."""
    return WayLeft(np.empty(size), np.empty(size), np.empty(size))


@compiled
def solve_leg(jacobian: np.ndarray, lower: np.ndarray, left: WayLeft, moves: WayLeft) -> None:
    """Find what joints move a foot like that, by their Jacobian (rows, K); damped.

    Writes `moves`, and overwrites `left` and the buffer `lower` (rows, rows).
    """
    rows = len(jacobian)
    if rows == 3 and len(moves.gap) == 3:  # without memory in between all of it is a fifth faster
        of_joints, damped = transposed(matrix(jacobian, ())), _damped_inverse(matrix(jacobian, ()))
        store(turn(of_joints, turn(damped, vector(left.gap, ()))), moves.gap, ())
        store(turn(of_joints, turn(damped, vector(left.rate, ()))), moves.rate, ())
        store(turn(of_joints, turn(damped, vector(left.acceleration, ()))), moves.acceleration, ())
        return
    gram(jacobian, jacobian, 0.0, lower)
    # Three rows of m, three of rad: each kind by itself, so that no unit matters.
    for first in range(0, rows, 3):
        mean = (lower[first, first] + lower[first + 1, first + 1] + lower[first + 2, first + 2]) / 3
        for a in range(first, first + 3):
            lower[a, a] += _DAMPING * mean
    factor(lower)
    solve_factored(lower, left.gap)
    solve_factored(lower, left.rate)
    solve_factored(lower, left.acceleration)
    for k in range(len(moves.gap)):
        gap, rate, acceleration = 0.0, 0.0, 0.0
        for r in range(rows):
            gap += jacobian[r, k] * left.gap[r]
            rate += jacobian[r, k] * left.rate[r]
            acceleration += jacobian[r, k] * left.acceleration[r]
        moves.gap[k], moves.rate[k], moves.acceleration[k] = gap, rate, acceleration


@compiled
def _damped_inverse(rows: Rotation) -> Rotation:
    """Return (J J^T + d)^-1 of a 3 × 3 Jacobian by its cofactors; symmetric."""
    x, y, z = product(rows, transposed(rows))
    ridge = _DAMPING * (x[0] + y[1] + z[2]) / 3
    x, y, z = add(x, (ridge, 0.0, 0.0)), add(y, (0.0, ridge, 0.0)), add(z, (0.0, 0.0, ridge))
    share = 1.0 / dot(x, cross(y, z))
    return scale(share, cross(y, z)), scale(share, cross(z, x)), scale(share, cross(x, y))
