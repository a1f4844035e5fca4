"""The gaits of a biped, from measurements of its model."""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.errors import RobotError
from fbid_gym.motions.gait.command import Trim
from fbid_gym.motions.gait.flat_feet import ARRIVED
from fbid_gym.motions.gait.flat_gait import FlatFootGait
from fbid_gym.motions.gait.slope import Sense
from fbid_gym.motions.gait.strength import deepest_bend, swing_time
from fbid_gym.robots import Robot
from fbid_gym.robots.polygon import convex_hull

SOLE = 0.8  # share of the sole that the centre of pressure may use


class Pattern(NamedTuple):
    """A gait of two flat feet, whatever the robot's size.

    In units of weight, gravity, the leg's length l (`Stance.size`) and the speed sqrt(g l).
    """

    cycle: float | None  # pendulum times a cycle of two steps; None: as quickly as legs swing
    double: float  # share of a step in double support
    forward: float  # of gravity, greatest rate of the velocity ahead
    gain: float
    lift: float
    sink: float
    lowered: float  # by which a robot is lower than at home, as far as its knees can carry it
    top: float  # of the speed, greatest ahead
    start: float  # of the speed, greatest ahead that the first step is planned for
    moment: tuple[float, float]  # `Target.moment` that tilts the trunk, and that turns it
    width: float  # between the middles of the feet, of that at which soles all but touch
    lag: float  # by what share less than its planned velocity a foot in the air is damped towards


PATTERNS = {
    "walk": Pattern(3.4, 0.25, 0.4, 2.0, 0.07, 0.03, 0.04, 0.17, 0.14, (1.0, 1.0), math.inf, 0.0),
    "brisk_walk": Pattern(None, 0.1, 0.1, 4.0, 0.03, 0.06, 0.18, 0.32, 0.0, (1.2, 2.8), 1.5, 0.3),
}
"""Slowly and upright; and in quick, narrow steps with bent legs, hardly any double support and a
body that may pitch. The second goes twice as fast, sways less and falls less, see docs/v1.md."""

_LEAST, _MOST = 1.2, 2.0  # pendulum times a step, as quick as legs swing; slow steps err more
_AGILITY = 0.4  # of gravity, greatest rate of the velocity aside and of the turning
_SETTLE = 1.25  # pendulum times to shift the weight
_BEND = 0.05  # of the speed
_LOAD = 0.05  # of the weight
_LONGEST = 0.6  # of the leg
_WIDEST = 0.35  # of the leg, beyond the width
_GAP = 0.01  # of the leg, between soles side by side
_LEVEL = 0.02  # of the mean square distance of the feet from their middle
_HIGH = 0.04  # of the leg, by which the base of any robot that walks is lower than at home


def biped_gait(
    robot: Robot, name: str = "walk", integral_time: float = 0.0, cycle: float | None = None
) -> FlatFootGait:
    """Return a gait of a robot with two feet, a left one and a right one, on flat soles.

    Errors of the velocity last, or are made up for in an `integral_time`, see `Trim`. A `cycle`
    takes so many pendulum times, or as many as the pattern of the gait's name says.

    Raises:
        RobotError: the robot has not two feet, or not flat ones, or not side by side.
    """
    if robot.num_feet != 2:
        raise RobotError(
            f"Robot {robot.name!r} has {robot.num_feet} feet. "
            "Expected two flat feet to walk like a biped."
        )
    stance = Stance.of(robot)
    home, leg, geometry = stance.terms, stance.size, stance.geometry
    feet, turn = home.foot_position[0], home.world_from_foot[0]
    width = abs(feet[0, 1] - feet[1, 1])
    points = np.matvec(turn[geometry.foot_of_point], geometry.offset)[:, :2]
    for foot, called in enumerate(robot.foot_names):
        if len(convex_hull(points[geometry.foot_of_point == foot])) < 3:
            raise RobotError(
                f"The contact points of foot {called!r} of {robot.name!r} span no area. "
                "Expected two flat feet to walk like a biped."
            )
    sole = np.abs(points).max(axis=0)
    least_apart = 2.0 * float(sole[1]) + _GAP * leg
    if width < least_apart:
        raise RobotError(
            f"Feet {robot.foot_names[0]!r} and {robot.foot_names[1]!r} of {robot.name!r} stand "
            f"{width:.3g} m apart, and their soles are {2.0 * sole[1]:.3g} m wide. "
            "Expected feet side by side in the home pose."
        )
    pattern, gravity, speed = PATTERNS[name], robot.gravity, math.sqrt(robot.gravity * leg)
    lowered, omega, usual, share, haste = _bent(robot, pattern)
    period = 0.5 * (cycle or usual) / omega
    return FlatFootGait(
        sense=Sense(2.0 * period, _LEVEL * (0.5 * float(width)) ** 2),
        omega=omega,
        single=(1.0 - pattern.double) * period,
        double=pattern.double * period,
        top=share * pattern.top * speed,
        start=pattern.start * speed,
        moment=haste**2 * np.square(base_from_trunk(robot)) @ np.repeat(pattern.moment, (2, 1)),
        settle=_SETTLE / omega,
        agility=gravity * np.array([pattern.forward * haste, _AGILITY, _AGILITY / leg]),
        trim=Trim.of(integral_time, omega, gravity),
        gain=pattern.gain,
        height=float(home.base_position[0, 2] - feet[:, 2].mean() - lowered),
        crouch=lowered - _HIGH * leg,
        bend=_BEND * speed,
        width=min(float(width), pattern.width * least_apart),
        least_apart=least_apart,
        most_apart=float(width + _WIDEST * leg),
        longest=_LONGEST * leg,
        lift=pattern.lift * leg,
        sink=pattern.sink * speed,
        trail=1.0 - pattern.lag * haste**2,
        load=_LOAD * robot.weight,
        sole=SOLE * sole,
        points=SOLE * points,
        foot_of_point=geometry.foot_of_point,
        left=np.sign(feet[:, 1] - feet[:, 1].mean()),
        level=np.ascontiguousarray(turn),
        home=robot.home_qpos,
    )


def default_cycle(robot: Robot, name: str) -> float:
    """Return the pendulum times that a cycle of a robot's gait takes unless told otherwise."""
    return _bent(robot, PATTERNS[name])[2]


def _bent(robot: Robot, pattern: Pattern) -> tuple[float, float, float, float, float]:
    """How low and quickly a robot walks, and the shares of velocity and haste that its legs can do.

    Returns: m lower than at home, 1/s at which it falls then, pendulum times of a cycle, shares.
    """
    stance = Stance.of(robot)
    com, feet, leg = stance.terms.com[0], stance.terms.foot_position[0], stance.size
    lowered = max(min(pattern.lowered * leg, deepest_bend(robot)), _HIGH * leg)
    omega = math.sqrt(robot.gravity / (com[2] - feet[:, 2].mean() - lowered))
    if pattern.cycle is not None:
        return lowered, omega, pattern.cycle, 1.0, 1.0
    top = pattern.top * math.sqrt(robot.gravity * leg)
    quick = max(swing_time(robot, top, ARRIVED * (1.0 - pattern.double)) * omega, _LEAST)
    step = min(quick, _MOST)
    return lowered, omega, 2.0 * step, step / quick, (_LEAST / step) ** 2
