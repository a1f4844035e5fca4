"""Landing place of a point foot, and its motion to it."""

import math

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.motions.gait.command import GaitCommand
from fbid_gym.motions.gait.footholds import Leap, point_ahead, within_reach
from fbid_gym.motions.gait.heading import turned
from fbid_gym.motions.gait.lifting import Step
from fbid_gym.motions.gait.point_gait import PointFootGait, PointGaitMemory
from fbid_gym.motions.gait.slope import Plane, height_on
from fbid_gym.motions.gait.swing import Moving, across, below, over
from fbid_gym.motions.gait.touchdown import SWING
from fbid_gym.quantities import DynamicsTerms, Target

_RAMP = 0.4  # pendulum times in which a foot that finds no ground comes to reach for it


@compiled
def swing_or_reach(
    gait: PointFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    plane: Plane,
    step: Step,
    tick: float,
    memory: PointGaitMemory,
    target: Target,
) -> None:
    """Say how a foot in the air moves."""
    i, foot = step.robot, step.foot
    if step.mode == SWING:
        if step.begins:
            _begin(terms.foot_position, memory, i, foot)
        _find_foothold(gait, command, terms, plane, step, memory, target)
        for axis in range(2):
            end = target.foothold[i, foot, axis]
            way = across(step.share, step.span, memory.begun[i, foot, axis], end)
            _aim(way, target, i, foot, axis)
        end = target.foothold[i, foot, 2]
        height = over(step.share, step.span, memory.begun[i, foot, 2], end, gait.lift)
        _aim(height, target, i, foot, 2)
        return
    if step.begins:
        _find_foothold(gait, command, terms, plane, step, memory, target)
        _begin(target.foothold, memory, i, foot)
        memory.clock[i, foot] = 0.0
    memory.clock[i, foot] += tick
    way = below(memory.clock[i, foot], _RAMP / gait.omega, gait.sink)
    for axis in range(3):
        target.foothold[i, foot, axis] = memory.begun[i, foot, axis]
        _aim(Moving(memory.begun[i, foot, axis], 0.0, 0.0), target, i, foot, axis)
    down = Moving(memory.begun[i, foot, 2] - way.value, -way.rate, -way.acceleration)
    _aim(down, target, i, foot, 2)


@compiled
def _begin(places: np.ndarray, memory: PointGaitMemory, i: int, foot: int) -> None:
    for axis in range(3):
        memory.begun[i, foot, axis] = places[i, foot, axis]


@compiled
def _aim(motion: Moving, target: Target, i: int, foot: int, axis: int) -> None:
    target.foot_position[i, foot, axis] = motion.value
    target.foot_velocity[i, foot, axis] = motion.rate
    target.foot_acceleration[i, foot, axis] = motion.acceleration


@compiled
def _find_foothold(
    gait: PointFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    plane: Plane,
    step: Step,
    memory: PointGaitMemory,
    target: Target,
) -> None:
    """Choose where a foot lands: where the robot's fall asks for it, within reach."""
    i, foot, left = step.robot, step.foot, (1.0 - step.share) * step.span
    stance = gait.schedule.duty * gait.schedule.period / command.rate[i]
    turning, heading = memory.velocity[i, 2], memory.heading[i]
    # Where the body will be and how it will move when the foot lands, and which way it will face
    # when it passes over the foot.
    base = (
        terms.base_position[i, 0] + terms.com_velocity[i, 0] * left,
        terms.base_position[i, 1] + terms.com_velocity[i, 1] * left,
    )
    landing = turned(turning * left, terms.com_velocity[i, 0], terms.com_velocity[i, 1])
    facing = heading + turning * (left + 0.5 * stance)
    wanted = turned(facing, memory.velocity[i, 0], memory.velocity[i, 1])
    place = turned(facing, gait.place[foot, 0], gait.place[foot, 1])
    shift = turned(facing, command.shift[i, foot, 0], command.shift[i, foot, 1])
    leap = Leap(gait.omega, stance, gait.capture)
    x = base[0] + place[0] + shift[0] + point_ahead(leap, landing[0], wanted[0])
    y = base[1] + place[1] + shift[1] + point_ahead(leap, landing[1], wanted[1])

    # Within reach when the foot lands, and, as far as that allows, until it lifts.
    known = command.ground[min(i, len(command.ground) - 1), foot]
    ground = height_on(plane, x, y) if math.isnan(known) else known
    height = terms.base_position[i, 2] + gait.hip[foot, 2] - ground
    radius = math.sqrt(max(gait.reach[foot] ** 2 - height**2, 0.0))
    hip = turned(heading + turning * left, gait.hip[foot, 0], gait.hip[foot, 1])
    lands = (base[0] + hip[0], base[1] + hip[1])
    hip = turned(heading + turning * (left + stance), gait.hip[foot, 0], gait.hip[foot, 1])
    lifts = (base[0] + hip[0] + wanted[0] * stance, base[1] + hip[1] + wanted[1] * stance)
    x, y, trails = within_reach(lifts, radius, x, y)
    x, y, far = within_reach(lands, radius, x, y)
    target.clipped[i, foot] = trails or far
    target.foothold[i, foot, 0], target.foothold[i, foot, 1] = x, y
    target.foothold[i, foot, 2] = height_on(plane, x, y) if math.isnan(known) else known
