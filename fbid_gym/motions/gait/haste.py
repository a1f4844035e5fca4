"""Haste: how a robot on two soles walks faster than a sole can balance the swing of a leg.

A foot that goes two strides v T by the quintic of `swing.rise`, in the share s of the step's time
T that it is in the air, is accelerated by up to 5.77 * 2 v / (s^2 T). The moment that the leg's
swing takes has to come from the sole, which is short, or from the body, which then pitches; and the
joints have to be strong enough. So a step gets no shorter than the joints can swing the leg, a
robot goes no faster than that, and its legs bend, to reach farther, no more than its knees carry.
"""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.dynamics.stance import Stance
from fbid_gym.robots import Robot

# In units of the robot: of the pendulum time sqrt(h / g), the leg's length l, its speed sqrt(g l).
_USUAL, _FAST, _TOP = 0.14, 0.17, 0.32  # of the speed
_GATHER = 0.05  # of gravity
_DOUBLE = 0.1  # of a step in double support
_LEAST, _LONGEST = 1.5, 2.0  # pendulum times a step
_ARRIVED = 0.95  # of the swing: `flat_feet`
_LOWER = 0.1  # of the leg, by which a robot is lower than at home, where knees can carry it
_KNEES = 1.0  # of a joint's torque, to carry the robot on one leg
_MOMENT = 0.15


class Haste(NamedTuple):
    """How a robot walks in all haste; constants. `Haste.of` makes those of a robot."""

    usual: float  # m/s ahead, up to which a robot is in no haste
    fast: float  # m/s ahead, from which on it is in all haste
    top: float  # m/s ahead, greatest that it follows
    gather: float  # m/s^2, greatest rate of velocities ahead beyond the usual ones
    single: float  # s in single support
    double: float  # s in double support
    crouch: float  # m by which the base is lower
    moment: float  # `Target.moment`

    @classmethod
    def of(cls, robot: Robot, omega: float, lowered: float) -> "Haste":
        """Derive it from the strength of a robot's legs.

        Args:
            robot: on two soles.
            omega: 1/s, rate at which it falls.
            lowered: m by which its base is lower than at home when it is in no haste.
        """
        stance = Stance.of(robot)
        leg, speed = stance.size, math.sqrt(robot.gravity * stance.size)
        swing, shares, crouches = _ARRIVED * (1.0 - _DOUBLE), [], []
        for foot, moves in enumerate(stance.legs):
            joints = np.flatnonzero(moves)
            jacobian, rows = stance.terms.foot_jacobian[0, foot][:, 6 + joints], 6 + joints
            limit, matrix = robot.torque_limit[joints], stance.terms.mass_matrix[0]
            # Per m/s^2 of the foot ahead, its rotation kept.
            ahead = np.linalg.pinv(jacobian, rcond=1e-6)[:, 0]
            shares.append(np.max(np.abs(matrix[np.ix_(rows, rows)] @ ahead) / limit))
            # The knee is the joint that makes the leg longer. With both parts of a leg alike, its
            # lever r and the distance D of the leg's ends keep r^2 + D^2 / 4.
            along = stance.hips[foot] - stance.terms.foot_position[0, foot]
            levers = np.abs(along / np.linalg.norm(along) @ jacobian[:3])
            knee = int(np.argmax(levers))
            spare = (_KNEES * limit[knee] / robot.weight) ** 2 - levers[knee] ** 2
            crouches.append(leg * (1.0 - math.sqrt(max(1.0 - 4.0 * spare / leg**2, 0.0))))
        needed = 5.77 * 2.0 * _TOP * speed / swing**2 * float(max(shares)) * omega
        period = min(max(needed, _LEAST), _LONGEST) / omega
        return cls(
            usual=_USUAL * speed,
            fast=_FAST * speed,
            top=_TOP * speed * min(1.0, _LONGEST / max(needed, _LEAST)),
            gather=_GATHER * robot.gravity,
            single=(1.0 - _DOUBLE) * period,
            double=_DOUBLE * period,
            crouch=max(min(_LOWER * leg, *crouches) - lowered, 0.0),
            moment=_MOMENT,
        )


@compiled
def haste_at(haste: Haste, velocity: float) -> float:
    """Return how much haste a velocity ahead (m/s) takes, from 0 to 1."""
    return min(max((abs(velocity) - haste.usual) / (haste.fast - haste.usual), 0.0), 1.0)


@compiled
def gathered(haste: Haste, before: float, now: float, tick: float) -> float:
    """Return the velocity (m/s) that follows one `before`, of one that is `now` within agility.

    Args:
        haste: of the robot.
        before: m/s ahead.
        now: m/s ahead.
        tick: s between the two.
    """
    most = haste.gather * tick
    if max(abs(before), abs(now)) > haste.usual:
        now = before + min(max(now - before, -most), most)
    return min(max(now, -haste.top), haste.top)
