"""The walking gait of a biped, from measurements of its model."""

import math

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import RobotError
from fbid_gym.motions.gait.command import Trim
from fbid_gym.motions.gait.flat_gait import FlatFootGait
from fbid_gym.motions.gait.haste import Haste
from fbid_gym.motions.gait.slope import Sense
from fbid_gym.robots import Robot
from fbid_gym.robots.polygon import convex_hull

PERIOD = 3.4
"""Pendulum times a cycle of two steps."""

SOLE = 0.8
"""Share of the sole that the centre of pressure may use."""

# In units of the robot: of the pendulum time sqrt(h / g), the leg's length (`Stance.size`), its
# speed sqrt(g l), its weight and its soles.
_DOUBLE = 0.25  # of a step in double support
_SETTLE = 1.25  # pendulum times to shift the weight
_AGILITY = 0.4  # of gravity
_GAIN = 2.0
_LIFT = 0.07
_SINK = 0.03
_BEND = 0.05
_LOAD = 0.05
_LONGEST = 0.6
_WIDEST = 0.35  # of the leg, beyond the width
_GAP = 0.01  # of the leg, between soles side by side
_LEVEL = 0.02  # of the mean square distance of the feet from their middle
_LOWER = 0.04  # of the leg, by which a walking robot's base is lower than at home


def biped_gait(robot: Robot, integral_time: float = 0.0, cycle: float = PERIOD) -> FlatFootGait:
    """Return the gait of a robot with two feet, a left one and a right one, on flat soles.

    Errors of the velocity last, or are made up for in an `integral_time`, see `Trim`. A `cycle` in
    no haste takes so many pendulum times.

    Raises:
        RobotError: the robot has not two feet, or not flat ones, or not side by side.
    """
    if robot.num_feet != 2:
        raise RobotError(
            f"Robot {robot.name!r} has {robot.num_feet} feet. "
            "Expected two flat feet to walk like a biped."
        )
    stance = Stance.of(robot)
    home, leg = stance.terms, stance.size
    feet, turn = home.foot_position[0], home.world_from_foot[0]
    width = abs(feet[0, 1] - feet[1, 1])
    geometry = stance.geometry
    points = np.matvec(turn[geometry.foot_of_point], geometry.offset)[:, :2]
    for foot, name in enumerate(robot.foot_names):
        if len(convex_hull(points[geometry.foot_of_point == foot])) < 3:
            raise RobotError(
                f"The contact points of foot {name!r} of {robot.name!r} span no area. "
                "Expected two flat feet to walk like a biped."
            )
    sole = np.abs(points).max(axis=0)
    ground = feet[:, 2].mean()
    if width < 2.0 * sole[1] + _GAP * leg:
        raise RobotError(
            f"Feet {robot.foot_names[0]!r} and {robot.foot_names[1]!r} of {robot.name!r} stand "
            f"{width:.3g} m apart, and their soles are {2.0 * sole[1]:.3g} m wide. "
            "Expected feet side by side in the home pose."
        )
    gravity = robot.gravity
    omega = math.sqrt(gravity / (home.com[0, 2] - ground - _LOWER * leg))
    period = 0.5 * cycle / omega
    return FlatFootGait(
        sense=Sense(2.0 * period, _LEVEL * (0.5 * float(width)) ** 2),
        omega=omega,
        single=(1.0 - _DOUBLE) * period,
        double=_DOUBLE * period,
        haste=Haste.of(robot, omega, _LOWER * leg),
        settle=_SETTLE / omega,
        agility=_AGILITY * gravity * np.array([1.0, 1.0, 1.0 / leg]),
        trim=Trim.of(integral_time, omega, gravity),
        gain=_GAIN,
        height=float((1.0 - _LOWER) * leg + (home.base_position[0, 2] - ground - leg)),
        bend=_BEND * math.sqrt(gravity * leg),
        width=float(width),
        least_apart=float(2.0 * sole[1] + _GAP * leg),
        most_apart=float(width + _WIDEST * leg),
        longest=_LONGEST * leg,
        lift=_LIFT * leg,
        sink=_SINK * math.sqrt(gravity * leg),
        load=_LOAD * robot.weight,
        sole=SOLE * sole,
        points=SOLE * points,
        foot_of_point=geometry.foot_of_point,
        left=np.sign(feet[:, 1] - feet[:, 1].mean()),
        level=np.ascontiguousarray(turn),
        home=robot.home_qpos,
    )
