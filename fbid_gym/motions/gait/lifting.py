"""When point feet lift and land, and when a robot on them sets out and comes to a stop."""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.motions.gait.command import GaitCommand
from fbid_gym.motions.gait.heading import turned
from fbid_gym.motions.gait.point_gait import PointFootGait, PointGaitMemory
from fbid_gym.motions.gait.schedule import since_lift
from fbid_gym.motions.gait.touchdown import STANCE, next_mode
from fbid_gym.quantities import DynamicsTerms


class Step(NamedTuple):
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
) -> Step:
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
    return Step(i, foot, mode, mode != before, swing * period, share)
