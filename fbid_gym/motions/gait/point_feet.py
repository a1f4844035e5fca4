"""Walking on point feet: a clock says when they lift, the robot's fall where they land.

A robot that is told to stand stands on all feet. It walks from the moment when a velocity is
commanded, or when it is pushed so far that it has to step, until it is told to stand, has come to
rest and has its feet below it. Each foot unloads before it lifts and takes up load after it lands,
the commanded velocity changes at a limited rate, and a foot lifts from where it is: nothing that is
planned here jumps but at a touchdown that comes early or late.
"""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.motions.gait.command import GaitCommand
from fbid_gym.motions.gait.footholds import Leap, Pair, point_ahead, turned, within_reach
from fbid_gym.motions.gait.schedule import Schedule, since_lift
from fbid_gym.motions.gait.swing import Motion, across, below, over
from fbid_gym.motions.gait.target import GaitTarget
from fbid_gym.motions.gait.touchdown import REACH, STANCE, SWING, next_mode
from fbid_gym.quantities import DynamicsTerms

_LOST_HEADING = 0.3  # rad that the robot may be turned from its heading before that follows


class PointFootGait(NamedTuple):
    """How a robot walks; constants, of which `quadruped_gait` makes those of a robot. F feet.

    Attributes:
        schedule: of the feet.
        omega: 1/s, rate at which the robot falls, sqrt(gravity / height of the centre of mass).
        capture: share of an error of velocity that one step takes away.
        tracking: 1/s, rate at which the feet that stand take away errors of velocity.
        standing: 1/s^2, stiffness with which a robot that stands keeps over its feet.
        agility: (3,) m/s^2, m/s^2 and rad/s^2, greatest rates of the commanded velocity.
        rest: m/s below which a robot is at rest.
        astray: m between feet and their places below which a robot may stand still.
        margin: m, distance of the capture point from the middle of the feet at which a robot that
            stands has to step.
        height: m, of the base above the ground.
        lift: m that a foot is lifted above the higher end of its step.
        sink: m/s with which a foot reaches for the ground.
        touch: N on a foot that count as contact.
        unload: s in which a foot gives up its load, or takes it.
        place: (F, 2) m, of each foot from the base at home, ahead and to the left.
        hip: (F, 3) m, of each hip from the base at home, ahead, to the left and up.
        reach: (F,) m, greatest distance of a foothold from its hip.
        foot_of_point: (P,) int64.
    """

    schedule: Schedule
    omega: float
    capture: float
    tracking: float
    standing: float
    agility: np.ndarray
    rest: float
    astray: float
    margin: float
    height: float
    lift: float
    sink: float
    touch: float
    unload: float
    place: np.ndarray
    hip: np.ndarray
    reach: np.ndarray
    foot_of_point: np.ndarray


class GaitMemory(NamedTuple):
    """What gaits remember from tick to tick, see `standing`.

    Attributes:
        phase: (N,) of the schedule.
        walking: (N,) bool, whether feet may lift.
        settled: (N,) share to which a robot that stands is held over its feet.
        velocity: (N, 3) m/s, m/s, rad/s: the command as it is followed.
        heading: (N,) rad, integral of the rate that is followed.
        ground: (N,) m, height of the ground on which the robot stands.
        mode: (N, F) int64, what each foot is doing: `STANCE`, `SWING` or `REACH`.
        clock: (N, F) s since a foot has begun to reach.
        begun: (N, F, 3) m, where a foot lifted, or began to reach.
        load: (N, F) share of its greatest force that a foot may take.
    """

    phase: np.ndarray
    walking: np.ndarray
    settled: np.ndarray
    velocity: np.ndarray
    heading: np.ndarray
    ground: np.ndarray
    mode: np.ndarray
    clock: np.ndarray
    begun: np.ndarray
    load: np.ndarray


def standing(heading: np.ndarray, foot_position: np.ndarray) -> GaitMemory:
    """Return the memory of robots that stand, with headings (N,) rad and feet at (N, F, 3) m."""
    feet = foot_position.shape[:2]
    return GaitMemory(
        phase=np.zeros(len(heading)),
        walking=np.zeros(len(heading), bool),
        settled=np.ones(len(heading)),
        velocity=np.zeros((len(heading), 3)),
        heading=np.array(heading, dtype=float),
        ground=foot_position[:, :, 2].mean(axis=1),
        mode=np.full(feet, STANCE),
        clock=np.zeros(feet),
        begun=np.array(foot_position, dtype=float),
        load=np.ones(feet),
    )


@kernel
def walk(
    gait: PointFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    contact_force: np.ndarray,
    tick: float,
    memory: GaitMemory,
) -> GaitTarget:
    """Go on by one control tick, and say what the robots shall do.

    Args:
        gait: of the robot.
        command: where to go.
        terms: where the robots are.
        contact_force: (N, P, 3) N, world, on the contact points.
        tick: s, of the control.
        memory: of the robots; updated.
    """
    count, feet = terms.foot_position.shape[:2]
    target = GaitTarget(
        planted=np.empty((count, feet), np.bool_),
        foot_position=terms.foot_position.copy(),
        world_from_foot=terms.world_from_foot.copy(),
        foot_velocity=np.zeros((count, feet, 6)),
        foot_acceleration=np.zeros((count, feet, 6)),
        load=np.empty((count, feet)),
        foothold=terms.foot_position.copy(),
        clipped=np.zeros((count, feet), np.bool_),
        velocity=np.empty((count, 2)),
        com_acceleration=np.empty((count, 2)),
        heading=np.empty(count),
        turning=np.empty(count),
        height=np.empty(count),
        cycle=np.empty(count),
    )
    touches, middle = np.empty(feet, np.bool_), np.empty(2)
    for i in range(count):
        _feel(gait, contact_force, touches, i)
        _follow(gait, command, terms, tick, memory, i)
        _stand_on(terms, touches, middle, memory, i)
        _start_or_stop(gait, command, terms, middle, memory, i)
        _tell_time(gait, command, tick, memory, i)
        for foot in range(feet):
            _step(gait, command, terms, _Foot(i, foot, touches[foot]), tick, memory, target)
        _lean(gait, terms, middle, tick, memory, target, i)
        target.height[i] = memory.ground[i] + gait.height
        target.cycle[i] = memory.phase[i]
    return target


@compiled
def _feel(gait: PointFootGait, contact_force: np.ndarray, touches: np.ndarray, i: int) -> None:
    """Find which feet carry weight."""
    for foot in range(len(touches)):
        load = 0.0
        for point in range(len(gait.foot_of_point)):
            if gait.foot_of_point[point] == foot:
                load += contact_force[i, point, 2]
        touches[foot] = load > gait.touch


@compiled
def _follow(
    gait: PointFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    tick: float,
    memory: GaitMemory,
    i: int,
) -> None:
    """Bring the velocity that is followed nearer to the command, and turn the heading with it."""
    for axis in range(3):
        most = gait.agility[axis] * tick
        change = command.velocity[i, axis] - memory.velocity[i, axis]
        memory.velocity[i, axis] += min(max(change, -most), most)
    body = math.atan2(terms.world_from_base[i, 1, 0], terms.world_from_base[i, 0, 0])
    ahead = memory.heading[i] + memory.velocity[i, 2] * tick - body
    ahead -= 2.0 * math.pi * math.floor(ahead / (2.0 * math.pi) + 0.5)
    memory.heading[i] = body + min(max(ahead, -_LOST_HEADING), _LOST_HEADING)


@compiled
def _stand_on(
    terms: DynamicsTerms, touches: np.ndarray, middle: np.ndarray, memory: GaitMemory, i: int
) -> None:
    """Find the middle of the feet that stand, and the ground below those that carry weight."""
    middle[:] = 0.0
    ground, planted, carrying = 0.0, 0, 0
    for foot in range(len(touches)):
        if memory.mode[i, foot] == STANCE:
            planted += 1
            for axis in range(2):
                middle[axis] += terms.foot_position[i, foot, axis]
            if touches[foot]:
                carrying += 1
                ground += terms.foot_position[i, foot, 2]
    if planted > 0:
        middle /= planted
    else:
        middle[:] = terms.com[i, :2]
    if carrying > 0:
        memory.ground[i] = ground / carrying


@compiled
def _start_or_stop(
    gait: PointFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    middle: np.ndarray,
    memory: GaitMemory,
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
    if (not still or math.hypot(x, y) > gait.margin) and _all_stand(memory, i):
        memory.walking[i] = True
        # The feet that lift first have the time to unload.
        ahead = gait.unload / gait.schedule.period
        memory.phase[i] = math.ceil(ahead) - ahead


@compiled
def _all_stand(memory: GaitMemory, i: int) -> bool:
    for foot in range(memory.mode.shape[1]):
        if memory.mode[i, foot] != STANCE:
            return False
    return True


@compiled
def _gathered(gait: PointFootGait, terms: DynamicsTerms, memory: GaitMemory, i: int) -> bool:
    """Whether the feet are about where they are at home."""
    for foot in range(len(gait.place)):
        x, y = turned(memory.heading[i], gait.place[foot, 0], gait.place[foot, 1])
        x += terms.base_position[i, 0] - terms.foot_position[i, foot, 0]
        y += terms.base_position[i, 1] - terms.foot_position[i, foot, 1]
        if math.hypot(x, y) > gait.astray:
            return False
    return True


@compiled
def _tell_time(
    gait: PointFootGait, command: GaitCommand, tick: float, memory: GaitMemory, i: int
) -> None:
    """Let the clock run, unless the robot stands still."""
    if memory.walking[i] or not _all_stand(memory, i):
        phase = memory.phase[i] + tick * command.rate[i] / gait.schedule.period
        memory.phase[i] = phase - math.floor(phase)


class _Foot(NamedTuple):
    """One foot of one robot."""

    robot: int
    foot: int
    touches: bool


@compiled
def _step(
    gait: PointFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    one: _Foot,
    tick: float,
    memory: GaitMemory,
    target: GaitTarget,
) -> None:
    """Say what one foot does."""
    i, foot, touches = one
    schedule = gait.schedule
    period, swing = schedule.period / command.rate[i], 1.0 - schedule.duty
    passed = since_lift(schedule, memory.phase[i], foot)
    share = passed / swing if passed < swing else 1.0
    before = memory.mode[i, foot]
    mode = next_mode(before, touches, memory.walking[i] and swing > 0.0, share)
    memory.mode[i, foot] = mode

    # A foot that is about to lift gives up its load; all others take it up.
    leaves = memory.walking[i] and swing > 0.0 and (1.0 - passed) * period <= gait.unload
    change = tick / gait.unload
    load = memory.load[i, foot] + (-change if leaves else change)
    memory.load[i, foot] = min(max(load, 0.0), 1.0) if mode == STANCE else 0.0
    target.load[i, foot] = memory.load[i, foot]
    target.planted[i, foot] = mode == STANCE
    if mode == STANCE:
        return

    if mode == SWING and before != SWING:
        _begin(terms.foot_position, memory, i, foot)
    left = (swing - passed) * period if mode == SWING else 0.0
    _find_foothold(gait, command, terms, left, memory, target, i, foot)
    if mode == SWING:
        span = swing * period
        for axis in range(2):
            end = target.foothold[i, foot, axis]
            way = across(share, span, memory.begun[i, foot, axis], end)
            _aim(way, target, i, foot, axis)
        end = target.foothold[i, foot, 2]
        height = over(share, span, memory.begun[i, foot, 2], end, gait.lift)
        _aim(height, target, i, foot, 2)
        return
    if before != REACH:
        _begin(target.foothold, memory, i, foot)
        memory.clock[i, foot] = 0.0
    memory.clock[i, foot] += tick
    way = below(memory.clock[i, foot], 1.0 / gait.omega, gait.sink)
    for axis in range(3):
        target.foothold[i, foot, axis] = memory.begun[i, foot, axis]
        _aim(Motion(memory.begun[i, foot, axis], 0.0, 0.0), target, i, foot, axis)
    down = Motion(memory.begun[i, foot, 2] - way.value, -way.rate, -way.acceleration)
    _aim(down, target, i, foot, 2)


@compiled
def _begin(places: np.ndarray, memory: GaitMemory, i: int, foot: int) -> None:
    for axis in range(3):
        memory.begun[i, foot, axis] = places[i, foot, axis]


@compiled
def _aim(motion: Motion, target: GaitTarget, i: int, foot: int, axis: int) -> None:
    target.foot_position[i, foot, axis] = motion.value
    target.foot_velocity[i, foot, axis] = motion.rate
    target.foot_acceleration[i, foot, axis] = motion.acceleration


@compiled
def _find_foothold(
    gait: PointFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    left: float,
    memory: GaitMemory,
    target: GaitTarget,
    i: int,
    foot: int,
) -> None:
    """Choose where a foot lands that has `left` s to go."""
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

    ground = command.ground[i, foot]
    if math.isnan(ground):
        ground = memory.ground[i]
    # Within reach when the foot lands, and, as far as that allows, until it lifts.
    height = terms.base_position[i, 2] + gait.hip[foot, 2] - ground
    radius = math.sqrt(max(gait.reach[foot] ** 2 - height**2, 0.0))
    hip = turned(heading + turning * left, gait.hip[foot, 0], gait.hip[foot, 1])
    lands: Pair = (base[0] + hip[0], base[1] + hip[1])
    hip = turned(heading + turning * (left + stance), gait.hip[foot, 0], gait.hip[foot, 1])
    lifts: Pair = (base[0] + hip[0] + wanted[0] * stance, base[1] + hip[1] + wanted[1] * stance)
    x, y, trails = within_reach(lifts, radius, x, y)
    x, y, far = within_reach(lands, radius, x, y)
    target.clipped[i, foot] = trails or far
    target.foothold[i, foot, 0], target.foothold[i, foot, 1] = x, y
    target.foothold[i, foot, 2] = ground


@compiled
def _lean(
    gait: PointFootGait,
    terms: DynamicsTerms,
    middle: np.ndarray,
    tick: float,
    memory: GaitMemory,
    target: GaitTarget,
    i: int,
) -> None:
    """Say how the body moves."""
    still = not memory.walking[i] and _all_stand(memory, i)
    # Held over the feet within a pendulum time, let go as fast as a foot unloads.
    change = tick * gait.omega if still else -tick / gait.unload
    memory.settled[i] = min(max(memory.settled[i] + change, 0.0), 1.0)
    x, y = turned(memory.heading[i], memory.velocity[i, 0], memory.velocity[i, 1])
    target.velocity[i, 0], target.velocity[i, 1] = x, y
    target.heading[i], target.turning[i] = memory.heading[i], memory.velocity[i, 2]
    # In a turn the velocity turns, too.
    target.com_acceleration[i, 0] = -memory.velocity[i, 2] * y
    target.com_acceleration[i, 1] = memory.velocity[i, 2] * x
    for axis in range(2):
        error = target.velocity[i, axis] - terms.com_velocity[i, axis]
        offset = middle[axis] - terms.com[i, axis]
        target.com_acceleration[i, axis] += gait.tracking * error
        target.com_acceleration[i, axis] += gait.standing * memory.settled[i] * offset
