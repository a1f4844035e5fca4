"""Walking on two flat feet: when they lift and land and where, and how the robot leans over them.

Three phases: standing on both feet, double support on the way to the foot that will carry, and
swing of the other one. A step begins when the foot in the air touches the ground; in it the centre
of pressure goes to that foot, and rolls from its heel to its toe if the gait has it so. Balance is
a law for the divergent component of motion xi (`divergent`): the centre of pressure departs from
its plan by (1 + gain) times the error of xi, as far as the soles reach, and the next foothold
corrects the rest. So the robot does not follow planned footprints: it steps where it must to go on
with the commanded velocity.

Plans start from the present state: each double support takes xi and the centre of pressure as it
finds them, so that starting, stepping and stopping are without jumps. A new velocity is approached
at a limited rate, and with it the foothold of the foot in the air.
"""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.motions.gait.biped import (
    ARRIVED,
    DOUBLE,
    LONG_AGO,
    STAND,
    SWING,
    FlatFootGait,
    FlatGaitMemory,
)
from fbid_gym.motions.gait.command import GaitCommand, approached, follow
from fbid_gym.motions.gait.divergent import (
    StepTiming,
    error_to_come,
    fall,
    offset_ahead,
    offset_inward,
    stride_to_catch,
    transfer,
)
from fbid_gym.motions.gait.heading import Pair, along, axes_of, in_world, wrapped
from fbid_gym.motions.gait.hull import nearest_in_hull
from fbid_gym.motions.gait.slope import Plane, feel_ground, height_on
from fbid_gym.motions.gait.swing import lift_and_land, rise
from fbid_gym.motions.gait.touchdown import load_on
from fbid_gym.motions.target import face, move_along, stand_where_it_is
from fbid_gym.quantities import DynamicsTerms, Target

_EARLIEST = 0.6  # share of a swing before which a loaded foot has not left the ground yet
_FASTEST = 2.0  # times as fast as planned that a foot hurries to a foothold out of reach
_TINY = 1e-12  # keeps the direction of a foot that points up or down defined
_BESIDE = 0.15  # of the sole's length, or of the width: feet that stand beside each other


@kernel
def walk(
    gait: FlatFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    contact_force: np.ndarray,
    tick: float,
    memory: FlatGaitMemory,
    target: Target,
) -> None:
    """Advance by one control tick, and write the robots' target; see `point_feet.walk`."""
    points = np.empty(gait.points.shape)
    for i in range(len(terms.com)):
        _go_on(gait, command, terms, contact_force, tick, points, memory, target, i)


@compiled
def _go_on(
    gait: FlatFootGait,
    command: GaitCommand,
    terms: DynamicsTerms,
    contact_force: np.ndarray,
    tick: float,
    points: np.ndarray,
    memory: FlatGaitMemory,
    target: Target,
    i: int,
) -> None:
    """Advance one robot; `points` (P, 2) is a buffer."""
    follow(gait.agility, gait.trim, command, terms, tick, memory, i)
    memory.velocity[i, 0] = min(max(memory.velocity[i, 0], -gait.top), gait.top)
    for foot in range(2):
        stand_where_it_is(target, terms, i, foot)
    axes = axes_of(memory.heading[i])
    xi = (
        terms.com[i, 0] + terms.com_velocity[i, 0] / gait.omega,
        terms.com[i, 1] + terms.com_velocity[i, 1] / gait.omega,
    )
    if memory.clock[i] == LONG_AGO:
        # First tick: its support is taken to be below its capture point, at rest.
        memory.pressure[i, 0], memory.pressure[i, 1] = xi[0], xi[1]
        memory.lowered[i] = -gait.crouch
    memory.clock[i] += tick
    memory.progress[i] += tick * memory.hurry[i]

    timing = _timing(gait, memory, i)
    now = _Now(i, timing, axes, xi)
    _change_phase(gait, now, command, terms, contact_force, memory)
    _settle(gait, terms, tick, memory, target, i)
    error = _balance(gait, now, terms, points, memory, target)
    plane = feel_ground(gait.sense, tick, memory.touched[i], memory.moments[i])
    base = terms.base_position[i]
    memory.lowered[i] = approached(memory.lowered[i], command.lowered[i], gait.bend * tick)
    target.qpos[i, 2] = height_on(plane, base[0], base[1]) + gait.height - memory.lowered[i]
    velocity = (0.0, 0.0, 0.0)
    if memory.phase[i] != STAND:
        velocity = (memory.velocity[i, 0], memory.velocity[i, 1], memory.velocity[i, 2])
    if memory.phase[i] == SWING:
        _find_foothold(gait, now, command, plane, error, memory, target)
        _swing(gait, timing, velocity[2], memory, target, i)
    x, y = in_world(axes, velocity[0], velocity[1])
    face(target, gait.home, memory.heading[i], i)
    move_along(target, gait.home, x, y, velocity[2], i)
    target.cycle[i] = _cycle(gait, timing, memory, i)
    target.moment[i] = gait.moment


class _Now(NamedTuple):
    """State of one robot."""

    robot: int
    timing: StepTiming
    axes: Pair  # cosine and sine of its heading
    xi: Pair  # m, its divergent component


@compiled
def _timing(gait: FlatFootGait, memory: FlatGaitMemory, i: int) -> StepTiming:
    """Return the time that the present step takes."""
    return StepTiming(gait.omega, gait.double / memory.rate[i], gait.single / memory.rate[i])


@compiled
def _roll(gait: FlatFootGait, timing: StepTiming, velocity: float) -> float:
    """Return how far (m) ahead of a foot the centre of pressure goes, from as far behind.

    With the robot, at `velocity` (m/s ahead), while the foot stands alone, or as the gait allows.
    """
    return min(max(0.5 * velocity * timing.single, -gait.roll), gait.roll)


@compiled
def _rolled(roll: float, timing: StepTiming, clock: float) -> float:
    """Return how far (m) ahead of the foot it is after `clock` s in single support."""
    return roll * (2.0 * min(clock / timing.single, 1.0) - 1.0)


@compiled
def _offset(gait: FlatFootGait, timing: StepTiming, velocity: Pair, foot: int) -> Pair:
    """Return where xi shall be from a foot as double support ends, along the heading."""
    period, roll = timing.double + timing.single, _roll(gait, timing, velocity[0])
    # Sideways every second step is the longer one: the other one shall not come closer.
    width = gait.width + abs(velocity[1]) * period
    return (
        offset_ahead(timing, velocity[0] * period, roll),
        offset_ahead(timing, velocity[1] * period, 0.0)
        - gait.left[foot] * offset_inward(timing, width),
    )


@compiled
def _change_phase(
    gait: FlatFootGait,
    now: _Now,
    command: GaitCommand,
    terms: DynamicsTerms,
    contact_force: np.ndarray,
    memory: FlatGaitMemory,
) -> None:
    """Lift, land, start and stop."""
    i, timing, axes, xi = now
    velocity, followed, still = command.velocity[i], memory.velocity[i], True
    for axis in range(3):
        still &= velocity[axis] == 0.0 and followed[axis] == 0.0
    feet = terms.foot_position[i]
    if memory.phase[i] == STAND:
        x = xi[0] - 0.5 * (feet[0, 0] + feet[1, 0])
        y = xi[1] - 0.5 * (feet[0, 1] + feet[1, 1])
        x, y = along(axes, x, y)
        falls = abs(x) > gait.sole[0] or abs(y) > 0.5 * gait.width
        if falls or not still:
            # The foot on the side where it goes swings first, and a falling robot stays on the
            # foot that it falls to.
            side = y if falls else -velocity[1] if velocity[1] != 0.0 else -velocity[2]
            memory.carrier[i] = 0 if side * gait.left[0] > 0.0 else 1
            span = 0.5 * timing.double if falls else gait.settle
            # No foot is in the air: the first step is planned for the command.
            ahead = min(max(velocity[0], -gait.start), gait.start)
            _set_out(gait, span, DOUBLE, (ahead, velocity[1]), command, xi, memory, i)
    elif memory.phase[i] == DOUBLE and memory.clock[i] >= memory.span[i]:
        foot = 1 - memory.carrier[i]
        memory.phase[i], memory.clock[i], memory.span[i] = SWING, 0.0, timing.single
        memory.progress[i], memory.hurry[i] = 0.0, 1.0
        for axis in range(3):
            memory.lifted[i, axis] = feet[foot, axis]
        cosine, sine = _foot_axes(gait, terms, i, foot)
        memory.lifted_heading[i] = math.atan2(sine, cosine)
    elif memory.phase[i] == SWING and memory.progress[i] > _EARLIEST * timing.single:
        foot = 1 - memory.carrier[i]
        if load_on(foot, gait.foot_of_point, contact_force[i]) > gait.load:
            x, y = along(axes, feet[foot, 0] - feet[1 - foot, 0], feet[foot, 1] - feet[1 - foot, 1])
            near = abs(x) < _BESIDE * gait.sole[0] * 2.0
            near &= abs(y * gait.left[foot] - gait.width) < _BESIDE * gait.width
            memory.carrier[i] = foot
            phase, span = (STAND, gait.settle) if still and near else (DOUBLE, -1.0)
            _set_out(gait, span, phase, (followed[0], followed[1]), command, xi, memory, i)


@compiled
def _set_out(
    gait: FlatFootGait,
    span: float,
    phase: int,
    velocity: Pair,
    command: GaitCommand,
    xi: Pair,
    memory: FlatGaitMemory,
    i: int,
) -> None:
    """Begin a double support, or standing, from the present state; a span below 0 is as timed."""
    memory.span[i] = span if span >= 0.0 else _timing(gait, memory, i).double
    memory.phase[i], memory.clock[i], memory.rate[i] = phase, 0.0, command.rate[i]
    memory.planned[i, 0], memory.planned[i, 1] = velocity
    for axis in range(2):
        memory.xi[i, axis] = xi[axis]
        memory.begun[i, axis] = memory.pressure[i, axis]


@compiled
def _settle(
    gait: FlatFootGait,
    terms: DynamicsTerms,
    tick: float,
    memory: FlatGaitMemory,
    target: Target,
    i: int,
) -> None:
    """Say how far the centre of mass is from where a robot that stands is held."""
    stands = memory.phase[i] == STAND
    # Held over the feet as it comes to stand, let go until the first foot lifts.
    change = tick / gait.settle if stands else -tick / memory.span[i]
    memory.settled[i] = min(max(memory.settled[i] + change, 0.0), 1.0)
    for axis in range(2):
        middle = 0.5 * (terms.foot_position[i, 0, axis] + terms.foot_position[i, 1, axis])
        target.qpos[i, axis], com = terms.base_position[i, axis], terms.com[i, axis]
        target.com[i, axis] = com + memory.settled[i] * (middle - com)


@compiled
def _foot_axes(gait: FlatFootGait, terms: DynamicsTerms, i: int, foot: int) -> Pair:
    """Cosine and sine of the angle by which a foot is turned about the vertical."""
    # The foot's axis that points ahead at home.
    x, y = 0.0, 0.0
    for axis in range(3):
        x += terms.world_from_foot[i, foot, 0, axis] * gait.level[foot, 0, axis]
        y += terms.world_from_foot[i, foot, 1, axis] * gait.level[foot, 0, axis]
    size = math.hypot(x, y) + _TINY
    return x / size, y / size


@compiled
def _balance(
    gait: FlatFootGait,
    now: _Now,
    terms: DynamicsTerms,
    points: np.ndarray,
    memory: FlatGaitMemory,
    target: Target,
) -> Pair:
    """Choose the centre of pressure; return the error of xi, along the heading."""
    i, timing, axes, xi = now
    feet, carrier, phase = terms.foot_position[i], memory.carrier[i], memory.phase[i]
    offset = _offset(gait, timing, (memory.planned[i, 0], memory.planned[i, 1]), carrier)
    offset = in_world(axes, offset[0], offset[1])
    roll = in_world(axes, _roll(gait, timing, memory.planned[i, 0]), 0.0)
    passed = min(memory.clock[i], timing.single)
    error_x, error_y, wanted_x, wanted_y = 0.0, 0.0, 0.0, 0.0
    for axis in range(2):
        if phase == SWING:
            rolled = _rolled(roll[axis], timing, memory.clock[i])
            xi_plan = fall(gait.omega, offset[axis], -roll[axis], rolled, passed)
            xi_plan, plan = feet[carrier, axis] + xi_plan, feet[carrier, axis] + rolled
        else:
            if phase == STAND:
                end = 0.5 * (feet[0, axis] + feet[1, axis])
                xi_end = end
            else:
                end = feet[carrier, axis]
                xi_end = end + offset[axis]
                end -= roll[axis]
            xi_plan, plan = transfer(
                gait.omega, memory.xi[i, axis], memory.begun[i, axis], xi_end, end,
                memory.span[i], memory.clock[i],
            )  # fmt: skip
        error = xi[axis] - xi_plan
        wanted = plan + (1.0 + gait.gain) * error
        if axis == 0:
            error_x, wanted_x = error, wanted
        else:
            error_y, wanted_y = error, wanted

    corners = 0
    for foot in range(2):
        target.planted[i, foot] = phase != SWING or foot == carrier
        target.load[i, foot] = 1.0 if target.planted[i, foot] else 0.0
        # A foot that has not landed in time has found that the ground is no higher.
        if target.planted[i, foot] or memory.progress[i] > timing.single:
            for axis in range(3):
                memory.touched[i, foot, axis] = feet[foot, axis]
        turned = _foot_axes(gait, terms, i, foot)
        for point in range(len(gait.points)):
            if gait.foot_of_point[point] == foot and target.planted[i, foot]:
                x, y = in_world(turned, gait.points[point, 0], gait.points[point, 1])
                points[corners, 0], points[corners, 1] = feet[foot, 0] + x, feet[foot, 1] + y
                corners += 1
    pressure = nearest_in_hull(points[:corners], (wanted_x, wanted_y))
    for axis in range(2):
        memory.pressure[i, axis] = pressure[axis]
        target.com_acceleration[i, axis] = gait.omega**2 * (terms.com[i, axis] - pressure[axis])
    return along(axes, error_x, error_y)


@compiled
def _find_foothold(
    gait: FlatFootGait,
    now: _Now,
    command: GaitCommand,
    plane: Plane,
    error: Pair,
    memory: FlatGaitMemory,
    target: Target,
) -> None:
    """Choose the place where the foot in the air shall land."""
    i, timing, axes, xi = now
    foot = 1 - memory.carrier[i]
    stands, foothold = memory.touched[i, memory.carrier[i]], target.foothold[i, foot]
    # Of s left, those of the pace that it has had.
    left = max(timing.single - memory.progress[i], 0.0) / memory.hurry[i]
    roll = _roll(gait, timing, memory.planned[i, 0])
    rolled = _rolled(roll, timing, memory.clock[i])
    x, y = along(axes, xi[0] - stands[0], xi[1] - stands[1])
    x = fall(gait.omega, x - error[0], rolled, roll, left)
    y = fall(gait.omega, y - error[1], 0.0, 0.0, left)
    # The feedback counts on half of the sole that is left beyond the plan, to that side.
    reach = 0.5 * (gait.sole[0] - math.copysign(1.0, error[0]) * 0.5 * (rolled + roll))
    x += error_to_come(gait.omega, gait.gain, error[0], reach, left)
    y += error_to_come(gait.omega, gait.gain, error[1], 0.5 * gait.sole[1], left)
    wanted = _offset(gait, timing, (memory.velocity[i, 0], memory.velocity[i, 1]), foot)
    x = stride_to_catch(timing, x, wanted[0], roll) + command.shift[i, foot, 0]
    y = stride_to_catch(timing, y, wanted[1], 0.0) + command.shift[i, foot, 1]
    apart = gait.left[foot] * y
    near_x = min(max(x, -gait.longest), gait.longest)
    near = min(max(apart, gait.least_apart), gait.most_apart)
    missed = abs(x - near_x) + abs(apart - near)
    target.clipped[i, foot] = missed > 0.0
    memory.hurry[i] = min(1.0 + missed / gait.width, _FASTEST)
    x, y = in_world(axes, near_x, gait.left[foot] * near)
    foothold[0], foothold[1] = stands[0] + x, stands[1] + y
    ground = command.ground[min(i, len(command.ground) - 1), foot]
    foothold[2] = height_on(plane, foothold[0], foothold[1]) if math.isnan(ground) else ground


@compiled
def _swing(
    gait: FlatFootGait,
    timing: StepTiming,
    turning: float,
    memory: FlatGaitMemory,
    target: Target,
    i: int,
) -> None:
    """Move the foot in the air."""
    foot, clock, span = 1 - memory.carrier[i], memory.progress[i], timing.single
    share, rate, acceleration = rise(clock / (ARRIVED * span), ARRIVED * span)
    for axis in range(2):
        begin = memory.lifted[i, axis]
        way = target.foothold[i, foot, axis] - begin
        target.foot_position[i, foot, axis] = begin + way * share
        target.foot_velocity[i, foot, axis] = gait.trail * way * rate
        target.foot_acceleration[i, foot, axis] = way * acceleration
    start, ground = memory.lifted[i, 2], target.foothold[i, foot, 2]
    height, fall, pull = lift_and_land(
        clock, span, start, max(start, ground) + gait.lift, ground, gait.sink
    )
    target.foot_position[i, foot, 2] = height
    target.foot_velocity[i, foot, 2], target.foot_acceleration[i, foot, 2] = fall, pull

    # It lands turned to where the robot will head in the middle of the next step.
    left = max(span - clock, 0.0) / memory.hurry[i] + 0.5 * (timing.double + span)
    turn = wrapped(memory.heading[i] + turning * left - memory.lifted_heading[i])
    angle = memory.lifted_heading[i] + turn * share
    turned = axes_of(angle)
    for axis in range(3):
        x, y = in_world(turned, gait.level[foot, 0, axis], gait.level[foot, 1, axis])
        target.world_from_foot[i, foot, 0, axis], target.world_from_foot[i, foot, 1, axis] = x, y
        target.world_from_foot[i, foot, 2, axis] = gait.level[foot, 2, axis]
    target.foot_velocity[i, foot, 5] = turn * rate
    target.foot_acceleration[i, foot, 5] = turn * acceleration
    for axis in range(6):
        target.foot_velocity[i, foot, axis] *= memory.hurry[i]
        target.foot_acceleration[i, foot, axis] *= memory.hurry[i] ** 2


@compiled
def _cycle(gait: FlatFootGait, timing: StepTiming, memory: FlatGaitMemory, i: int) -> float:
    """Share of the cycle: each half begins when a foot lands, the left one's first."""
    if memory.phase[i] == STAND:
        return 0.0
    period = timing.double + timing.single
    passed = min(memory.clock[i], memory.span[i])
    if memory.phase[i] == SWING:
        passed = timing.double + min(memory.progress[i], timing.single)
    first = 0.0 if gait.left[memory.carrier[i]] > 0.0 else 0.5
    return first + 0.5 * min(passed / period, 1.0)
