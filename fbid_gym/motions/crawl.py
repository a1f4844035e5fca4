"""A quadruped's walk with three feet on the ground, as LittleDog's in [M10] IV.E.

One foot swings at a time, both feet of the left side after another, then both of the right. The
body moves on at constant speed, level, and sways to the side whose feet stand, so that the centre
of mass lies in the triangle of the three planted feet at every instant: the walk could stop
anywhere. The paper takes its gait from a planner that is not given; this is a plain one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyder, polyval

from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError, RobotError
from fbid_gym.motions.curves import Curve, cosine
from fbid_gym.motions.gait.schedule import corners_of
from fbid_gym.motions.kinematics import (
    States,
    chunked,
    foot_radius,
    home_points,
    joints_on_feet,
    seen_from_feet,
)
from fbid_gym.motions.legs import placing, refuse_beyond
from fbid_gym.motions.squat import period_ticks
from fbid_gym.motions.table import MotionTable, look_up, side_by_side
from fbid_gym.quantities import Target
from fbid_gym.robots import Robot
from fbid_gym.robots.polygon import margin_within


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


_ORDER = (2, 0, 3, 1)
"""In which the feet swing: hind left, front left, hind right, front right, of `corners_of`."""

_MOST_TABLES = 6  # polynomials through more equally spaced points swing between them

# From the coefficients of a quintic to its value and two derivatives at both ends, 0 and 1.
_ENDS = np.array([polyval(end, polyder(np.eye(6), k)) for end in (0.0, 1.0) for k in range(3)])


@dataclass(frozen=True, eq=False)
class Crawl:
    """The walk at any speed between two; T ticks a period, K speeds.

    Attributes:
        speeds: (K,) m/s, ascending.
        tables: the walk at these speeds.
        rows: (T, K, D) the numbers of `side_by_side`, as coefficients of
            the polynomial through the planned speeds: of 1, u, u^2 ..., where u runs from 0 at the
            least speed to 1 at the largest.
        gait: its numbers.
    """

    speeds: np.ndarray
    tables: tuple[MotionTable, ...]
    rows: np.ndarray
    gait: CrawlGait

    @property
    def period(self) -> int:
        """Ticks of one period."""
        return self.tables[0].period

    @property
    def hz(self) -> int:
        """Ticks per second."""
        return self.tables[0].hz

    def reference(self, tick: np.ndarray, speed: np.ndarray) -> Target:
        """Return the desired motion of N robots, interpolated between the planned speeds.

        Args:
            tick: (N,) int control ticks since the motion began, not negative.
            speed: (N,) m/s, forward.

        Raises:
            InvalidValueError: a speed beyond those of the gait.
        """
        slow, fast = self.speeds[[0, -1]]
        if not (speed.min() >= slow - 1e-9 and speed.max() <= fast + 1e-9):
            # The farthest one, or one that is no number.
            worst = float(speed[np.argmax(np.abs(speed - 0.5 * (slow + fast)))])
            raise InvalidValueError("speed", worst, f"a speed in [{slow:g}, {fast:g}] m/s")
        share = (speed - slow) / max(fast - slow, 1e-12)
        planted = self.tables[0].planted  # the same at all speeds
        return look_up(self.rows, planted, np.ascontiguousarray(tick), share, True)


def crawl(robot: Robot, gait: CrawlGait | None = None, *, hz: int = 500) -> Crawl:
    """Plan a crawl.

    Args:
        robot: a quadruped: at each corner a foot of one contact point, on three joints or more. Of
            more the three that place the foot best move, the others stay at home.
        gait: its numbers. Default: those of `gait_for`.
        hz: ticks per second.

    Raises:
        RobotError: the robot has other feet or other joints.
        InvalidValueError: a number is not valid, a foot cannot reach its place, a joint leaves its
            range, or the centre of mass what the planted feet span.
    """
    moving = stepping_joints(robot)
    gait = gait_for(robot, hz) if gait is None else gait
    _check(gait)
    ticks = period_ticks("stride frequency", 1.0 / gait.period, hz)
    speeds = np.linspace(gait.slowest, gait.fastest, gait.tables)
    tables = []
    guess = np.tile(robot.home_qpos[7:], (ticks, 1))
    for speed in speeds:
        tables.append(_table(robot, gait, ticks, hz, float(speed), guess, moving))
        guess = tables[-1].rows.qpos[:, 7:]
    rows = [side_by_side(table.rows) for table in tables]
    powers = np.linspace(0.0, 1.0, gait.tables)[:, None] ** np.arange(gait.tables)
    coefficients = np.linalg.inv(powers) @ np.stack(rows, axis=1)
    return Crawl(speeds, tuple(tables), coefficients, gait)


def _check(gait: CrawlGait) -> None:
    for name, value, least, most, text in (
        ("period", gait.period, 0.0, np.inf, "a positive number of seconds"),
        ("swing", gait.swing, 0.0, 0.25, "a share of the period in (0, 0.25)"),
        ("swing_height", gait.swing_height, 0.0, np.inf, "a positive number of metres"),
        ("fastest", gait.fastest - gait.slowest, -1e-12, np.inf, "no less than `slowest`"),
    ):
        if not least < value < most:
            raise InvalidValueError(name, getattr(gait, name), text)
    least = 1 if gait.slowest == gait.fastest else 2
    if not least <= gait.tables <= _MOST_TABLES:
        raise InvalidValueError("tables", gait.tables, f"{least} to {_MOST_TABLES} speeds")


def _table(
    robot: Robot,
    gait: CrawlGait,
    ticks: int,
    hz: int,
    speed: float,
    guess: np.ndarray,
    moving: Sequence[int],
) -> MotionTable:
    """Plan the walk at one speed.

    Feet are planned over one period each, from touching down to touching down, and the body over
    the time that all of these cover: everything else is periodic.
    """
    time = np.arange(ticks) / hz
    stride = speed * ticks / hz
    sway = cosine(time, 1.0 / gait.period, np.pi / 2).scaled(gait.sway / (1.0 - gait.flatness))
    corner = cosine(time, 3.0 / gait.period, np.pi / 2)
    sway = sway.plus(corner.scaled(gait.sway * gait.flatness / (1.0 - gait.flatness)))
    surge = cosine(time, 2.0 / gait.period, -np.pi / 2).scaled(gait.surge)
    forward = Curve(speed * time, np.full(ticks, speed), np.zeros(ticks))
    base = States(
        np.tile(robot.home_qpos, (ticks, 1)),
        np.zeros((ticks, robot.nv)),
        np.zeros((ticks, robot.nv)),
    )
    points = home_points(robot)
    home, stance = robot.home_qpos[:2].copy(), Stance.of(robot)
    # The centre of mass above the middle of the feet, where it may not be at home.
    base.qpos[:, :2] = home + (stance.home_base - stance.home_com)[:2]
    base.qpos[:, 2] = robot.home_qpos[2] + gait.height
    for axis, curve in ((0, forward.plus(surge)), (1, sway)):
        for whole, part in zip(base, curve, strict=True):
            whole[:, axis] += part

    feet = [list(corners_of(robot)).index(corner) for corner in _ORDER]
    # The two swings of a side follow each other; their middle is at a quarter, and three quarters.
    length, quarter = round(gait.swing * ticks), round(0.25 * ticks)
    lifts = [start + half for half in (0, ticks // 2) for start in (quarter - length, quarter)]
    # First tick in the air and first tick on the ground again.
    schedule = {foot: (lift, lift + length) for foot, lift in zip(feet, lifts, strict=True)}
    planted = np.ones((ticks, robot.num_feet), bool)
    for foot, (lift, touch) in schedule.items():
        planted[lift:touch, foot] = False
    standing = planted.copy()
    for foot, (lift, _) in schedule.items():
        standing[lift, foot] = True  # it leaves the ground as it rolled on it

    radius = foot_radius(robot)
    # Height of a swinging foot over its ticks in the air and the next one: smooth at both ends.
    share, seconds = np.arange(length + 1) / length, length / hz
    height = 64 * gait.swing_height * Polynomial([0.0, 1.0, -1.0]) ** 3
    rates = height.deriv()(share) / seconds, height.deriv(2)(share) / seconds**2
    bump = Curve(height(share), *rates)

    def centres(spin: np.ndarray, rate: np.ndarray) -> Curve:
        """Place the spheres' centres, for feet that roll with this spin."""
        places = Curve(*np.zeros((3, ticks, robot.num_feet, 3)))
        for foot, (lift, touch) in schedule.items():
            # Along the ground, a sphere moves by its radius times the angle it turns.
            rolled = Curve(
                np.zeros((ticks, 2)),
                radius[foot] * _across(spin[:, foot]),
                radius[foot] * _across(rate[:, foot]),
            )
            path = _foot_path(rolled, lift, touch, stride, 1.0 / hz)
            middle = ((touch + lift + ticks) / 2 - ticks) / hz
            where = points[foot].copy()
            where[:2] += home
            where[0] += speed * middle
            where[1] += np.sign(where[1] - home[1]) * gait.spread
            for whole, part in zip(places, path, strict=True):
                whole[:, foot, :2] += part
            for whole, part in zip(places, bump, strict=True):
                whole[lift : touch + 1, foot, 2] += part
            places.value[:, foot] += where
        return places

    states = joints_on_feet(robot, base, centres, standing, moving, guess)
    _check_over_feet(robot, states, planted)
    return MotionTable(robot, seen_from_feet(robot, states, planted), hz, periodic=True)


def _check_over_feet(robot: Robot, states: States, planted: np.ndarray) -> None:
    """Check that the centre of mass stays above the hull of the planted feet (T, F)."""
    least = np.inf
    for rows, terms in chunked(MuJoCoDynamics(robot), states.qpos, states.qvel):
        for feet, down, com in zip(terms.foot_position, planted[rows], terms.com, strict=True):
            least = min(least, margin_within(feet[down, :2], com[:2]))
    refuse_beyond(robot, least)


def _across(turn: np.ndarray) -> np.ndarray:
    """Direction (T, 2) in which a sphere rolls: turn × z."""
    return np.stack([turn[:, 1], -turn[:, 0]], axis=1)


def _foot_path(rolled: Curve, lift: int, touch: int, stride: float, step: float) -> Curve:
    """Way of a foot's centre along the ground over one period, (T, 2) m, from mid-stance.

    Args:
        rolled: rates of its rolling; the value is not used.
        lift: first tick in the air.
        touch: first tick on the ground again.
        stride: m, the body's way in one period.
        step: s, a tick.
    """
    ticks = len(rolled.rate)
    path = Curve(*(part.copy() for part in rolled))
    # The stance in order: from touching down to lifting, which may lie in the next period.
    stance = np.arange(touch, lift + ticks + 1)
    rate, acceleration = (part[stance % ticks] for part in rolled[1:])
    piece = 0.5 * step * (rate[1:] + rate[:-1])
    piece += step**2 / 12 * (acceleration[:-1] - acceleration[1:])
    way = np.concatenate([np.zeros((1, 2)), np.cumsum(piece, axis=0)])
    half = len(way) // 2
    way -= way[half] if len(way) % 2 else 0.5 * (way[half - 1] + way[half])
    # The stance that begins in this period is one stride further on than the one that ends in it.
    next_one = np.array([stride, 0.0])
    path.value[stance % ticks] = way + np.where(stance < ticks, 1.0, 0.0)[:, None] * next_one

    # Through the air a quintic, from the state in which the foot lifts to that in which it lands.
    seconds = (touch - lift) * step
    first = way[-1], rate[-1] * seconds, acceleration[-1] * seconds**2
    last = way[0] + next_one, rate[0] * seconds, acceleration[0] * seconds**2
    quintic = np.linalg.solve(_ENDS, np.array([*first, *last]))
    swing = np.arange(lift + 1, touch)
    for degree, whole in enumerate(path):
        share = (swing - lift) * step / seconds
        whole[swing] = polyval(share, polyder(quintic, degree)).T / seconds**degree
    return path
