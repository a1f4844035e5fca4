"""Task `crawl`: walk at a commanded speed, three feet on the ground at a time, [M10] IV.E."""

from functools import lru_cache

from fbid_gym import motions
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
    speed_range: tuple[float, float] = (0.0, 0.08),
    step_seconds: float = 1.5,
    swing_height: float = 0.05,
) -> Tracking:
    """Build the task.

    Args:
        robot: the quadruped, or one with feet of the same names.
        seconds: length of an episode.
        hz: control ticks per second.
        pushes: the disturbances.
        start: how an episode begins.
        speed_range: (least, most) m/s, commanded forward speed, constant in an episode.
        step_seconds: s, period of the walk: each foot steps once.
        swing_height: m, how high a swinging foot is lifted.
    """
    motion = _motion(robot, hz, step_seconds, swing_height, *speed_range)
    return Tracking.of(robot, seconds, hz, pushes, start, motion, speed_range)


# Planning takes seconds, and every chunk of a batch asks for the same.
@lru_cache(maxsize=8)
def _motion(
    robot: Robot,
    hz: int,
    step_seconds: float,
    swing_height: float,
    slowest: float,
    fastest: float,
) -> motions.Crawl:
    gait = motions.Gait(
        period=step_seconds, swing_height=swing_height, slowest=slowest, fastest=fastest
    )
    return motions.crawl(robot, gait, hz=hz)
