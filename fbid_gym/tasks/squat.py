"""Task `squat`: squat and bow on planted feet, [M10] IV.B."""

from typing import Annotated

from fbid_gym.motions import squat_bow, squat_depth
from fbid_gym.options import Number, checked
from fbid_gym.robots.measured import once_for_robot
from fbid_gym.tasks.task import Episode
from fbid_gym.tasks.tracking import Tracking


@checked
def squat(
    episode: Episode,
    *,
    speed: Annotated[float, Number(0.01, 20.0)] = 1.0,
    depth: Annotated[float, Number(0.01, 3.0, "rad")] | None = None,
) -> Tracking:
    """Build the task.

    Args:
        episode: of a robot on two soles, with hips, knees and ankles that pitch.
        speed: of the motion; 1 is the slow one of [M10] figure 4, 5 the fast one of figure 5.
        depth: rad, of the squat at the knee. None: as deep as the robot can, see `squat_depth`.
    """
    robot = episode.body.robot
    depth = squat_depth(robot) if depth is None else depth
    motion = _motion(robot, speed=speed, depth=depth, hz=episode.hz)
    return Tracking.of(episode, motion, {"depth": depth})


# Planning takes seconds, and every chunk of a batch asks for the same.
_motion = once_for_robot(squat_bow)
