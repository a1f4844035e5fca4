"""Task `step`: squat while stepping in place, under pushes, [M10] IV.D."""

from functools import lru_cache
from typing import Annotated

from fbid_gym.motions import MotionTable, Steps, stepping
from fbid_gym.options import Number, checked
from fbid_gym.robots import Robot
from fbid_gym.tasks.pushes import Pushes
from fbid_gym.tasks.start import Start
from fbid_gym.tasks.tracking import Tracking


@checked
def step(
    robot: Robot,
    seconds: float,
    hz: int,
    pushes: Pushes,
    start: Start,
    *,
    step_seconds: Annotated[float, Number(0.01, 1000.0, "s")] = 3.0,
    lift_seconds: Annotated[float, Number(0.0, 1000.0, "s")] = 0.25,
) -> Tracking:
    """Build the task.

    Args:
        robot: the biped, or one with joints of the same names.
        seconds: length of an episode.
        hz: control ticks per second.
        pushes: the disturbances.
        start: how an episode begins.
        step_seconds: s, period of the stepping: each foot steps once.
        lift_seconds: s it takes a foot to rise, and to come down again; 0 is the instant change of
            the paper.
    """
    motion = _motion(robot, hz, step_seconds, lift_seconds)
    return Tracking.of(robot, seconds, hz, pushes, start, motion)


# Planning takes seconds, and every chunk of a batch asks for the same.
@lru_cache(maxsize=8)
def _motion(robot: Robot, hz: int, step_seconds: float, lift_seconds: float) -> MotionTable:
    return stepping(robot, Steps(period=step_seconds, ramp=lift_seconds), hz=hz)
