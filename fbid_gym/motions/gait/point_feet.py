"""Walking on point feet: a clock says when they lift, the robot's fall where they land.

A robot that is told to stand stands on all feet. It walks from the moment when a velocity is
commanded, or when it is pushed so far that it has to step, until it is told to stand, has come to
rest and has its feet below it. Each foot unloads before it lifts and takes up load after it lands,
the commanded velocity changes at a limited rate, and a foot lifts from where it is: nothing that is
planned here jumps but at a touchdown that comes early or late. The ground is taken to be the plane
through the places where the feet last stood, unless the command knows better.
"""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.motions.gait.command import GaitCommand, approached, follow
from fbid_gym.motions.gait.footholds import Leap, point_ahead, within_reach
from fbid_gym.motions.gait.heading import turned
from fbid_gym.motions.gait.quadruped import PointFootGait, PointGaitMemory
from fbid_gym.motions.gait.schedule import since_lift
from fbid_gym.motions.gait.slope import Plane, feel_ground, height_on
from fbid_gym.motions.gait.swing import Moving, across, below, over
from fbid_gym.motions.gait.touchdown import REACH, STANCE, SWING, load_on, next_mode
from fbid_gym.motions.target import face, move_along, stand_where_it_is
from fbid_gym.quantities import DynamicsTerms, Target


@kernel
def walk(
    gait: PointFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    contact_force: np.ndarray,
    tick: float,
    memory: PointGaitMemory,
    target: Target,
) -> None:
    """Advance by one control tick, and write the robots' target.

    The forces on the contact points are (N, P, 3) N, world; the tick is that of the control, s. The
    memory is updated.
    """
    touches, middle = np.empty(terms.foot_position.shape[1], np.bool_), np.empty(2)
    for i in range(len(terms.com)):
        _go_on(gait, command, terms, contact_force, tick, touches, middle, memory, target, i)


@compiled
def _go_on(
    gait: PointFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    contact_force: np.ndarray,
    tick: float,
    touches: np.ndarray,
    middle: np.ndarray,
    memory: PointGaitMemory,
    target: Target,
    i: int,
) -> None:
    """Advance one robot; `touches` (F,) and `middle` (2,) are buffers."""
    feet = len(touches)
    for foot in range(feet):
        load = load_on(foot, gait.foot_of_point, contact_force[i])
        touches[foot] = load > gait.touch
    follow(gait.agility, gait.trim, command, terms, tick, memory, i)
    _stand_on(terms, touches, middle, memory, i)
    plane = feel_ground(gait.sense, tick, memory.touched[i], memory.moments[i])
    start_or_stop(gait, command, terms, middle, memory, i)
    tell_time(gait, command, tick, memory, i)
    for foot in range(feet):
        step = lift_or_land(gait, command, tick, touches[foot], memory, i, foot)
        stand_where_it_is(target, terms, i, foot)
        target.planted[i, foot] = step.mode == STANCE
        target.load[i, foot] = memory.load[i, foot]
        if step.mode != STANCE:
            swing_or_reach(gait, command, terms, plane, step, tick, memory, target)
    _move_body(gait, terms, middle, tick, memory, target, i)
    base = terms.base_position[i]
    memory.lowered[i] = approached(memory.lowered[i], command.lowered[i], gait.bend * tick)
    target.qpos[i, 2] = height_on(plane, base[0], base[1]) + gait.height - memory.lowered[i]
    target.cycle[i] = memory.phase[i]


@compiled
def _stand_on(
    terms: DynamicsTerms, touches: np.ndarray, middle: np.ndarray, memory: PointGaitMemory, i: int
) -> None:
    """Find the middle of the feet that stand, and note where those are that carry weight."""
    middle[0], middle[1], planted = 0.0, 0.0, 0
    for foot in range(len(touches)):
        if memory.mode[i, foot] == STANCE:
            planted += 1
            for axis in range(2):
                middle[axis] += terms.foot_position[i, foot, axis]
        # A foot that reaches has found that the ground is no higher.
        if memory.mode[i, foot] == REACH or (memory.mode[i, foot] == STANCE and touches[foot]):
            for axis in range(3):
                memory.touched[i, foot, axis] = terms.foot_position[i, foot, axis]
    for axis in range(2):
        middle[axis] = middle[axis] / planted if planted > 0 else terms.com[i, axis]


@compiled
def _move_body(
    gait: PointFootGait,
    terms: DynamicsTerms,
    middle: np.ndarray,
    tick: float,
    memory: PointGaitMemory,
    target: Target,
    i: int,
) -> None:
    """Say how the body moves."""
    still = not memory.walking[i] and all_stand(memory, i)
    # Held over the feet within a pendulum time, let go as fast as a foot unloads.
    change = tick * gait.omega if still else -tick / gait.unload
    memory.settled[i] = min(max(memory.settled[i] + change, 0.0), 1.0)
    x, y = turned(memory.heading[i], memory.velocity[i, 0], memory.velocity[i, 1])
    face(target, gait.home, memory.heading[i], i)
    move_along(target, gait.home, x, y, memory.velocity[i, 2], i)
    # In a turn the velocity turns, too. The rate at which its size follows the command is left
    # out: with it go1 errs by 0.065 instead of 0.070 m/s, and 1 in 7 of a robot of 2.7 kg falls.
    target.com_acceleration[i, 0] = -memory.velocity[i, 2] * y
    target.com_acceleration[i, 1] = memory.velocity[i, 2] * x
    for axis in range(2):
        target.qpos[i, axis], com = terms.base_position[i, axis], terms.com[i, axis]
        target.com[i, axis] = com + memory.settled[i] * (middle[axis] - com)


class FootStep(NamedTuple):
    """State of one foot of one robot."""

    robot: int  # which
    foot: int  # which
    mode: int  # `STANCE`, `SWING` or `REACH`
    begins: bool  # whether it has only now begun to
    span: float  # s that a swing takes
    share: float  # of it that has passed


@compiled
def start_or_stop(
    gait: PointFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    middle: np.ndarray,
    memory: PointGaitMemory,
    i: int,
) -> None:
    """Decide whether feet may lift."""
    wanted, still = command.velocity[i], True
    for axis in range(3):
        still &= wanted[axis] == 0.0 and memory.velocity[i, axis] == 0.0
    if memory.walking[i]:
        speed = math.hypot(terms.com_velocity[i, 0], terms.com_velocity[i, 1])
        memory.walking[i] = not (still and speed < gait.rest and _gathered(gait, terms, memory, i))
        return
    x = terms.com[i, 0] + terms.com_velocity[i, 0] / gait.omega - middle[0]
    y = terms.com[i, 1] + terms.com_velocity[i, 1] / gait.omega - middle[1]
    if (not still or math.hypot(x, y) > gait.margin) and all_stand(memory, i):
        memory.walking[i] = True
        # The feet that lift first have the time to unload.
        ahead = gait.unload / gait.schedule.period
        memory.phase[i] = math.ceil(ahead) - ahead


@compiled
def all_stand(memory: PointGaitMemory, i: int) -> bool:
    """Return whether no foot is in the air."""
    for foot in range(memory.mode.shape[1]):
        if memory.mode[i, foot] != STANCE:
            return False
    return True


@compiled
def _gathered(gait: PointFootGait, terms: DynamicsTerms, memory: PointGaitMemory, i: int) -> bool:
    """Whether the feet are about where they are at home."""
    for foot in range(len(gait.place)):
        x, y = turned(memory.heading[i], gait.place[foot, 0], gait.place[foot, 1])
        x += terms.base_position[i, 0] - terms.foot_position[i, foot, 0]
        y += terms.base_position[i, 1] - terms.foot_position[i, foot, 1]
        if math.hypot(x, y) > gait.astray:
            return False
    return True


@compiled
def tell_time(
    gait: PointFootGait, command: GaitCommand, tick: float, memory: PointGaitMemory, i: int
) -> None:
    """Let the clock run, unless the robot stands still."""
    if memory.walking[i] or not all_stand(memory, i):
        phase = memory.phase[i] + tick * command.rate[i] / gait.schedule.period
        memory.phase[i] = phase - math.floor(phase)


@compiled
def lift_or_land(
    gait: PointFootGait,
    command: GaitCommand,
    tick: float,
    touches: bool,
    memory: PointGaitMemory,
    i: int,
    foot: int,
) -> FootStep:
    """Decide the mode of a foot, and the load that it may carry."""
    schedule, walking = gait.schedule, memory.walking[i]
    period, swing = schedule.period / command.rate[i], 1.0 - schedule.duty
    passed = since_lift(schedule, memory.phase[i], foot)
    share = passed / swing if passed < swing else 1.0
    before = memory.mode[i, foot]
    mode = next_mode(before, touches, walking and swing > 0.0, share)
    memory.mode[i, foot] = mode

    # A foot that is about to lift gives up its load; all others take it up.
    leaves = walking and swing > 0.0 and (1.0 - passed) * period <= gait.unload
    change = tick / gait.unload
    load = memory.load[i, foot] + (-change if leaves else change)
    memory.load[i, foot] = min(max(load, 0.0), 1.0) if mode == STANCE else 0.0
    return FootStep(i, foot, mode, mode != before, swing * period, share)


_RAMP = 0.4  # pendulum times in which a foot that finds no ground comes to reach for it


@compiled
def swing_or_reach(
    gait: PointFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    plane: Plane,
    step: FootStep,
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
    step: FootStep,
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
