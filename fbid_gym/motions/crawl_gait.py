"""The numbers of a crawl, and their scaling to robots of other sizes."""

from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import RobotError
from fbid_gym.motions.gait.schedule import corners_of
from fbid_gym.motions.legs import placing
from fbid_gym.robots import Robot


class CrawlGait(NamedTuple):
    """Numbers of a crawl.

    Attributes:
        period: s, one step of every foot.
        swing: share of the period that each foot is in the air.
        swing_height: m, how high a swinging foot is lifted.
        height: m, of the base over its height at home.
        sway: m, amplitude of the body's way sideways.
        flatness: share of the third harmonic in the sway, which keeps the body longer at its sides.
        surge: m, amplitude of the body's way forward and back, twice a period.
        spread: m, how much farther out than at home, from the body, the feet step.
        slowest: m/s, least forward speed.
        fastest: m/s, largest forward speed.
        tables: number of speeds at which the walk is planned; between them it is interpolated by a
            polynomial through all, so a few are enough.
    """

    period: float = 1.5
    swing: float = 0.16
    swing_height: float = 0.05
    height: float = -0.03
    sway: float = 0.035
    flatness: float = 0.1
    surge: float = 0.01
    spread: float = 0.025
    slowest: float = 0.0
    fastest: float = 0.08
    tables: int = 4


LITTLEDOG = CrawlGait()
"""A walk for a robot 0.3 m long and 0.2 m tall.

Low and with feet wide apart, since what tips it over an obstacle is a centre of mass that comes
near the line of the outer feet: with the feet and the height of the home stance it falls over
planks of 3 cm in most trials.
"""

# Of that robot: m between the middles of hind and front feet, of right and left ones, and from the
# feet to the centre of mass; and the time sqrt(height / g) in which it falls.
_LENGTH, _WIDTH, _HEIGHT, _TIME = 0.202, 0.1197, 0.15706796, 0.126534600


def gait_for(
    robot: Robot,
    hz: int,
    *,
    period: float | None = None,
    swing_height: float | None = None,
    speeds: tuple[float, float] | None = None,
) -> CrawlGait:
    """Return the walk of `LITTLEDOG` on a robot of another size.

    What goes up scales with the height of the centre of mass, what goes sideways or ahead with the
    distances of the feet, and time with how fast the robot falls over.

    Args:
        robot: the robot.
        hz: ticks per second; the period is a whole number of ticks.
        period: s, instead.
        swing_height: m, instead.
        speeds: (slowest, fastest) m/s, instead.

    Raises:
        RobotError: the robot has not one foot at each corner, or cannot crawl.
    """
    stepping_joints(robot)  # refuses robots that cannot crawl
    corners, stance = corners_of(robot), Stance.of(robot)
    feet = stance.terms.foot_position[0, np.argsort(corners), :2]
    front, hind, left, right = (
        feet[pair].mean(axis=0) for pair in ([0, 1], [2, 3], [0, 2], [1, 3])
    )
    long = float(np.linalg.norm(front - hind)) / _LENGTH
    wide = float(np.linalg.norm(left - right)) / _WIDTH
    high = float(stance.home_com[2]) / _HEIGHT
    slow = 1.0 / (stance.falling_rate * _TIME)
    usual = LITTLEDOG
    ticks = round(slow * usual.period * hz)
    return usual._replace(
        period=ticks / hz if period is None else period,
        swing_height=high * usual.swing_height if swing_height is None else swing_height,
        height=high * usual.height,
        sway=wide * usual.sway,
        surge=long * usual.surge,
        spread=wide * usual.spread,
        slowest=long / slow * usual.slowest if speeds is None else speeds[0],
        fastest=long / slow * usual.fastest if speeds is None else speeds[1],
    )


def stepping_joints(robot: Robot) -> list[int]:
    """Return the twelve joints with which a robot crawls: of each leg the three that place it.

    Raises:
        RobotError: other feet, or a leg of fewer joints.
    """
    stance = Stance.of(robot)
    if robot.num_feet != 4 or robot.num_points != 4 or (stance.legs.sum(axis=1) < 3).any():
        raise RobotError(
            f"Robot {robot.name!r} cannot crawl: it has {robot.num_joints} joints and the feet "
            f"{', '.join(robot.foot_names)} on {robot.num_points} points. Expected four feet on "
            "one point each, and three joints or more that move it alone."
        )
    legs = zip(stance.legs, stance.terms.foot_jacobian[0, :, :3], strict=True)
    own = [placing(np.flatnonzero(moves), foot, stance.length) for moves, foot in legs]
    return sorted(np.concatenate(own).tolist())
