"""Task `crawl`: walk at a commanded speed, three feet on the ground at a time, [M10] IV.E.

## Description
The motion ignores the ground: with `terrain="obstacles"` the feet hit planks.

## Action Space
The default gains of `joint_position` are for standing. Without a policy they are too soft here,
where the weight shifts from foot to foot: a `natural_frequency` of 8 Hz or more walks.
"""

from typing import Annotated

from fbid_gym import motions
from fbid_gym.options import Number, Pair, checked
from fbid_gym.robots.measured import once_for_robot
from fbid_gym.tasks.task import Episode
from fbid_gym.tasks.tracking import Tracking


@checked
def crawl(
    episode: Episode,
    *,
    speed_range: Annotated[tuple[float, float], Pair(-10.0, 10.0, "m/s")] | None = None,
    step_seconds: Annotated[float, Number(0.01, 1000.0, "s")] | None = None,
    swing_height: Annotated[float, Number(1e-4, 10.0, "m")] | None = None,
) -> Tracking:
    """Build the task.

    Args:
        episode: of a quadruped on point feet with three joints a leg.
        speed_range: (least, most) m/s, commanded forward speed, constant in an episode. None, as
            for the others: derived from the robot's size, see `motions.gait_for`.
        step_seconds: s, period of the walk: each foot steps once.
        swing_height: m, how high a swinging foot is lifted.
    """
    robot, hz = episode.body.robot, episode.hz
    own = {"period": step_seconds, "swing_height": swing_height}
    gait = motions.gait_for(robot, hz, **own, speeds=speed_range)
    motion, speeds = _motion(robot, gait, hz=hz), (gait.slowest, gait.fastest)
    derived = {"step_seconds": gait.period, "swing_height": gait.swing_height}
    return Tracking.of(episode, motion, {"speed_range": speeds, **derived}, speeds)


# Planning takes seconds, and every chunk of a batch asks for the same.
_motion = once_for_robot(motions.crawl)
