"""Task `crawl`: walk at a commanded speed, three feet on the ground at a time, [M10] IV.E."""

from functools import lru_cache

from fbid_gym import motions
from fbid_gym.checks import number, pair
from fbid_gym.robots import Robot
from fbid_gym.tasks.pushes import Pushes
from fbid_gym.tasks.start import Start
from fbid_gym.tasks.tracking import Tracking


def crawl(
    robot: Robot,
    seconds: float,
    hz: int,
    pushes: Pushes,
    start: Start,
    *,
    speed_range: tuple[float, float] | None = None,
    step_seconds: float | None = None,
    swing_height: float | None = None,
) -> Tracking:
    """Build the task.

    Args:
        robot: a quadruped on point feet with three joints a leg.
        seconds: length of an episode.
        hz: control ticks per second.
        pushes: the disturbances.
        start: how an episode begins.
        speed_range: (least, most) m/s, commanded forward speed, constant in an episode. None, as
            for the others: what a robot of this size can do, see `motions.gait_for`.
        step_seconds: s, period of the walk: each foot steps once.
        swing_height: m, how high a swinging foot is lifted.
    """
    speeds = None if speed_range is None else pair("speed_range", speed_range)
    period = None if step_seconds is None else number("step_seconds", step_seconds)
    lift = None if swing_height is None else number("swing_height", swing_height)
    motion = _motion(robot, hz, period, lift, speeds)
    gait = motion.gait
    speeds = gait.slowest, gait.fastest
    derived = {
        "speed_range": speeds,
        "step_seconds": gait.period,
        "swing_height": gait.swing_height,
    }
    return Tracking.of(robot, seconds, hz, pushes, start, motion, speeds, derived)


# Planning takes seconds, and every chunk of a batch asks for the same.
@lru_cache(maxsize=8)
def _motion(
    robot: Robot,
    hz: int,
    period: float | None,
    swing_height: float | None,
    speeds: tuple[float, float] | None,
) -> motions.Crawl:
    gait = motions.gait_for(robot, hz, period=period, swing_height=swing_height, speeds=speeds)
    return motions.crawl(robot, gait, hz=hz)
