"""Task `step`: squat while stepping in place, under pushes, [M10] IV.D."""

from typing import Annotated

from fbid_gym.motions import stepping, steps_for
from fbid_gym.options import Number, checked
from fbid_gym.robots.measured import once_for_robot
from fbid_gym.tasks.task import Episode
from fbid_gym.tasks.tracking import Tracking


@checked
def step(
    episode: Episode,
    *,
    step_seconds: Annotated[float, Number(0.01, 1000.0, "s")] | None = None,
    lift_seconds: Annotated[float, Number(0.0, 1000.0, "s")] | None = None,
) -> Tracking:
    """Build the task.

    Args:
        episode: of a robot on two soles, with hips, knees and ankles that pitch.
        step_seconds: s, period of the stepping: each foot steps once. None, as for the
            other: derived from the robot's size, see `motions.steps_for`.
        lift_seconds: s it takes a foot to rise, and to come down again; 0 is the instant change of
            the paper.
    """
    robot, hz = episode.body.robot, episode.hz
    steps = steps_for(robot, hz, period=step_seconds, ramp=lift_seconds)
    motion = _motion(robot, steps, hz=hz)
    derived = {"step_seconds": steps.period, "lift_seconds": steps.ramp}
    return Tracking.of(episode, motion, derived)


# Planning takes seconds, and every chunk of a batch asks for the same.
_motion = once_for_robot(stepping)
