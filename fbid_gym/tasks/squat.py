"""Task `squat`: squat and bow on planted feet, [M10] IV.B."""

from functools import lru_cache
from typing import Annotated

from fbid_gym.motions import squat_bow, squat_depth
from fbid_gym.options import Number, checked
from fbid_gym.robots import Robot
from fbid_gym.tasks.pushes import Pushes
from fbid_gym.tasks.start import Start
from fbid_gym.tasks.tracking import Tracking


@checked
def squat(
    robot: Robot,
    seconds: float,
    hz: int,
    pushes: Pushes,
    start: Start,
    *,
    speed: Annotated[float, Number(0.01, 20.0)] = 1.0,
    depth: Annotated[float, Number(0.01, 3.0, "rad")] | None = None,
) -> Tracking:
    """Build the task.

    Args:
        robot: one on two soles, with hips, knees and ankles that pitch.
        seconds: length of an episode.
        hz: control ticks per second.
        pushes: the disturbances.
        start: how an episode begins.
        speed: of the motion; 1 is the slow one of [M10] figure 4, 5 the fast one of figure 5.
        depth: rad, of the squat at the knee. None: what the robot can, see `squat_depth`.
    """
    depth = squat_depth(robot) if depth is None else depth
    motion = _motion(robot, speed=speed, depth=depth, hz=hz)
    return Tracking.of(robot, seconds, hz, pushes, start, motion, derived={"depth": depth})


# Planning takes seconds, and every chunk of a batch asks for the same.
_motion = lru_cache(maxsize=8)(squat_bow)
