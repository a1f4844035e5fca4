"""The gaits of a biped: constants, from measurements of its model, and memory."""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.trunk import about_base
from fbid_gym.errors import RobotError
from fbid_gym.motions.gait.command import Trim
from fbid_gym.motions.gait.slope import Sense, level_moments
from fbid_gym.motions.target import WALK_CYCLE
from fbid_gym.robots import Robot
from fbid_gym.robots.polygon import convex_hull

STAND, DOUBLE, SWING = 0, 1, 2
"""Phases: on both feet; on the way to the foot that will carry; the other one in the air."""

LONG_AGO = 1e9
"""s since a robot that has not walked yet began to stand: states are finite numbers."""


class FlatFootGait(NamedTuple):
    """A gait on two flat feet; constants, which `biped_gait` makes for a robot."""

    sense: Sense  # of the ground
    omega: float  # 1/s, rate at which the robot falls, sqrt(gravity / height of the centre of mass)
    single: float  # s in single support
    double: float  # s in double support
    top: float  # m/s ahead, greatest that it follows
    start: float  # m/s ahead, greatest that the first step is planned for
    moment: np.ndarray  # (3,) `Target.moment`; exact where base and trunk share axes, in any order
    settle: float  # s in which a robot that stands shifts its weight
    agility: np.ndarray  # (3,) m/s^2, m/s^2 and rad/s^2, greatest rates of the commanded velocity
    trim: Trim  # of the velocity
    gain: float  # of the centre of pressure on errors of xi, which decay with gain * omega
    height: float  # m, of the base above the ground below it
    crouch: float  # m by which it begins higher
    bend: float  # m/s with which the base is lowered, or raised again
    width: float  # m between the feet
    least_apart: float  # m between the feet, sideways
    most_apart: float  # m between the feet, sideways
    longest: float  # m between the feet, ahead
    lift: float  # m that a foot is lifted
    sink: float  # m/s with which a foot lands
    trail: float  # share of its planned level velocity that a foot in the air is damped towards
    load: float  # N on a foot that count as contact
    roll: float  # m, greatest, that the centre of pressure goes behind and ahead of a foot
    sole: np.ndarray  # (2,) m, half the length and half the width for the centre of pressure
    points: np.ndarray  # (P, 2) m, of that sole's corners from the foot's reference, ahead, left
    foot_of_point: np.ndarray  # (P,) int64
    left: np.ndarray  # (2,) 1 for the left foot, -1 for the right one
    level: np.ndarray  # (2, 3, 3) rotations of the feet when the robot stands with heading 0
    home: np.ndarray  # (nq,) of the robot


class FlatGaitMemory(NamedTuple):
    """Memory of gaits from tick to tick."""

    phase: np.ndarray  # (N,) int64
    carrier: np.ndarray  # (N,) int64, the foot that stands in the swing, or will
    clock: np.ndarray  # (N,) s since the phase began
    span: np.ndarray  # (N,) s that it takes
    settled: np.ndarray  # (N,) share to which a robot that stands is held over its feet
    velocity: np.ndarray  # (N, 3) m/s, m/s, rad/s: the command as it is followed
    trim: np.ndarray  # (N, 2) m/s, integral of the error, added to the command
    heading: np.ndarray  # (N,) rad, integral of the rate that is followed
    planned: np.ndarray  # (N, 2) m/s with which the step began
    rate: np.ndarray  # (N,) of steps, commanded then
    progress: np.ndarray  # (N,) s of the planned swing that have passed
    hurry: np.ndarray  # (N,) times as fast as planned that the foot swings
    xi: np.ndarray  # (N, 2) m, when the feet that stand last changed
    begun: np.ndarray  # (N, 2) m, centre of pressure then
    pressure: np.ndarray  # (N, 2) m, that of the last tick: what `Target.com_acceleration` comes of
    touched: np.ndarray  # (N, 2, 3) m, where each foot stands or last stood
    moments: np.ndarray  # (N, 5) m^2, of these places, see `slope.feel_ground`
    lifted: np.ndarray  # (N, 3) m, where the foot in the air left the ground
    lifted_heading: np.ndarray  # (N,) rad that it had then
    lowered: np.ndarray  # (N,) m by which the base is lower than the gait has it

    @classmethod
    def standing(cls, heading: np.ndarray, foot_position: np.ndarray) -> "FlatGaitMemory":
        """Return the memory of robots that stand, with headings (N,) rad and feet at (N, 2, 3) m.

        The ground below them is taken to be level until they have stood on it for a while.
        """
        count = len(heading)
        flat = np.zeros((5, count, 2))
        return cls(
            phase=np.full(count, STAND),
            carrier=np.zeros(count, np.int64),
            clock=np.full(count, LONG_AGO),
            span=np.ones(count),
            settled=np.ones(count),
            velocity=np.zeros((count, 3)),
            trim=np.zeros((count, 2)),
            heading=np.array(heading, dtype=float),
            planned=flat[0],
            rate=np.ones(count),
            progress=np.zeros(count),
            hurry=np.ones(count),
            xi=flat[1],
            begun=flat[2],
            pressure=flat[3],
            touched=np.array(foot_position, dtype=float),
            moments=level_moments(foot_position),
            lifted=np.zeros((count, 3)),
            lifted_heading=np.zeros(count),
            lowered=np.zeros(count),
        )


def swing_time(robot: Robot, velocity: float, share: float) -> float:
    """Return the shortest time of a step, s, in which every leg swings as the velocity asks.

    That is m/s ahead. A foot that goes two strides v T by the quintic of `swing.rise`, in the share
    s of the step's time T that it is in the air, is accelerated by up to 5.77 * 2 v / (s^2 T).
    """
    stance, limits = Stance.of(robot), robot.torque_limit
    matrix, worst = stance.terms.mass_matrix[0], 0.0
    for foot, moves in enumerate(stance.legs):
        joints = np.flatnonzero(moves)
        rows = 6 + joints
        jacobian = stance.terms.foot_jacobian[0, foot][:, rows]
        # Per m/s^2 of the foot ahead, its rotation kept.
        ahead = np.linalg.pinv(jacobian, rcond=1e-6)[:, 0]
        worst = max(worst, np.max(np.abs(matrix[np.ix_(rows, rows)] @ ahead) / limits[joints]))
    return 5.77 * 2.0 * velocity / share**2 * float(worst)


def deepest_bend(robot: Robot) -> float:
    """Return by how much a robot on two soles can be lower, m: as knees and joints' range allow."""
    stance, bends = Stance.of(robot), [math.inf]
    leg = stance.size
    for foot, moves in enumerate(stance.legs):
        joints = np.flatnonzero(moves)
        # The knee is the joint that makes the leg longer. With both parts of a leg alike, its lever
        # r and the distance D of the leg's ends keep r^2 + D^2 / 4.
        along = stance.hips[foot] - stance.terms.foot_position[0, foot]
        apart = float(np.linalg.norm(along))
        jacobian = stance.terms.foot_jacobian[0, foot][:, 6 + joints]
        levers = np.abs(along / apart @ jacobian[:3])
        knee = int(np.argmax(levers))
        most = robot.torque_limit[joints[knee]] / robot.weight  # on one leg
        spare = most**2 - levers[knee] ** 2
        bends.append(leg * (1.0 - math.sqrt(max(1.0 - 4.0 * spare / leg**2, 0.0))))
        # How far the joints turn while the knee does by 1 rad and the foot rises as it stands.
        turns = np.linalg.pinv(jacobian, rcond=1e-6)[:, 2]
        turns = turns / max(abs(turns[knee]), 1e-9)
        moving = np.abs(turns) > _IDLE
        ends = robot.joint_range[joints[moving]] - robot.home_qpos[7:][joints[moving], None]
        room = (ends / turns[moving, None]).max(axis=1)  # none of a leg that is straight
        further = _ROOM * max(room.min(initial=math.inf), 0.0)
        half, part = math.atan2(levers[knee], 0.5 * apart), math.hypot(levers[knee], 0.5 * apart)
        bends.append(apart - 2.0 * part * math.cos(min(half + 0.5 * further, 0.5 * math.pi)))
    return min(bends)


ARRIVED = 0.95  # share of a swing at which the foot is above its foothold
SOLE = 0.8  # share of the sole that the centre of pressure may use
_ROOM = 0.9  # share of the joints' range that bent legs may use
_IDLE = 0.05  # of the knee's turn; joints that turn less do not count


class FlatPattern(NamedTuple):
    """A gait of two flat feet, whatever the robot's size.

    In units of weight, gravity, the leg's length l (`Stance.size`) and the speed sqrt(g l).
    """

    cycle: float | None  # pendulum times a cycle of two steps; None: as quickly as legs swing
    double: float  # share of a step in double support
    forward: float  # of gravity, greatest rate of the velocity ahead
    gain: float
    lift: float
    sink: float
    lowered: float  # by which a robot is lower than at home, as far as its knees can carry it
    top: float  # of the speed, greatest ahead
    start: float  # of the speed, greatest ahead that the first step is planned for
    moment: tuple[float, float]  # `Target.moment` that tilts the trunk, and that turns it
    width: float  # between the middles of the feet, of that at which soles all but touch
    roll: float  # of half a sole, greatest that the centre of pressure goes to heel and toe
    lag: float  # by what share less than its planned velocity a foot in the air is damped towards


PATTERNS = {
    "walk": FlatPattern(
        WALK_CYCLE, 0.25, 0.4, 2.0, 0.07, 0.03, 0.04, 0.17, 0.14, (1.0, 1.0), math.inf, 0.0, 0.0
    ),
    "brisk_walk": FlatPattern(
        None, 0.1, 0.1, 4.0, 0.03, 0.06, 0.18, 0.32, 0.0, (1.2, 2.8), 1.5, 0.0, 0.3
    ),
}
PATTERNS["rolling_walk"] = PATTERNS["brisk_walk"]._replace(roll=0.9, lag=0.45)
"""Slowly and upright; in quick, narrow steps with bent legs, hardly any double support and a body
that may pitch; and the same with a centre of pressure that goes from heel to toe. The second goes
twice as fast as the first, sways less and falls less, see docs/two_legs.md."""

_LEAST, _MOST = 1.2, 2.0  # pendulum times a step, as quick as legs swing; slow steps err more
_AGILITY = 0.4  # of gravity, greatest rate of the velocity aside and of the turning
_SETTLE = 1.25  # pendulum times to shift the weight
_BEND = 0.05  # of the speed
_LOAD = 0.05  # of the weight
_LONGEST = 0.6  # of the leg
_WIDEST = 0.35  # of the leg, beyond the width
_GAP = 0.01  # of the leg, between soles side by side
_LEVEL = 0.02  # of the mean square distance of the feet from their middle
_HIGH = 0.04  # of the leg, by which the base of any robot that walks is lower than at home


def biped_gait(
    robot: Robot, name: str = "walk", integral_time: float = 0.0, cycle: float | None = None
) -> FlatFootGait:
    """Return a gait of a robot with two feet, a left one and a right one, on flat soles.

    Errors of the velocity last, or are made up for in an `integral_time`, see `Trim`. A `cycle`
    takes so many pendulum times, or as many as the pattern of the gait's name says.

    Raises:
        RobotError: the robot has not two feet, or not flat ones, or not side by side.
    """
    if robot.num_feet != 2:
        raise RobotError(
            f"Robot {robot.name!r} has {robot.num_feet} feet. "
            "Expected two flat feet to walk like a biped."
        )
    stance = Stance.of(robot)
    home, leg, geometry = stance.terms, stance.size, stance.geometry
    feet, turn = home.foot_position[0], home.world_from_foot[0]
    width = float(abs(feet[0, 1] - feet[1, 1]))
    left = np.sign(feet[:, 1] - feet[:, 1].mean())
    points = np.matvec(turn[geometry.foot_of_point], geometry.offset)[:, :2]
    soles = [points[geometry.foot_of_point == foot] for foot in range(2)]
    for sole, called in zip(soles, robot.foot_names, strict=True):
        if len(convex_hull(sole)) < 3:
            raise RobotError(
                f"The contact points of foot {called!r} of {robot.name!r} span no area. "
                "Expected two flat feet to walk like a biped."
            )
    # Of soles that are not the same on all sides of their references: the least that both have.
    halves = np.min([np.minimum(-sole.min(axis=0), sole.max(axis=0)) for sole in soles], axis=0)
    inner = [(-side * sole[:, 1]).max() for side, sole in zip(left, soles, strict=True)]
    least_apart = float(sum(inner)) + _GAP * leg
    if width < least_apart:
        raise RobotError(
            f"Feet {robot.foot_names} of {robot.name!r} are {width:.3g} m apart in the home pose. "
            f"Expected {least_apart:.3g} m at least, with their soles side by side."
        )
    pattern, gravity, speed = PATTERNS[name], robot.gravity, math.sqrt(robot.gravity * leg)
    lowered, omega, usual, share, haste = _bent(robot, pattern)
    period = 0.5 * (cycle or usual) / omega
    return FlatFootGait(
        sense=Sense(2.0 * period, _LEVEL * (0.5 * width) ** 2),
        omega=omega,
        single=(1.0 - pattern.double) * period,
        double=pattern.double * period,
        top=share * pattern.top * speed,
        start=pattern.start * speed,
        moment=haste**2 * about_base(robot, *pattern.moment),
        settle=_SETTLE / omega,
        agility=gravity * np.array([pattern.forward * haste, _AGILITY, _AGILITY / leg]),
        trim=Trim.of(integral_time, omega, gravity),
        gain=pattern.gain,
        height=float(home.base_position[0, 2] - feet[:, 2].mean() - lowered),
        crouch=lowered - _HIGH * leg,
        bend=_BEND * speed,
        width=min(width, pattern.width * least_apart),
        least_apart=least_apart,
        most_apart=width + _WIDEST * leg,
        longest=_LONGEST * leg,
        lift=pattern.lift * leg,
        sink=pattern.sink * speed,
        trail=1.0 - pattern.lag * haste**2,
        load=_LOAD * robot.weight,
        roll=pattern.roll * SOLE * float(halves[0]),
        sole=SOLE * halves,
        points=SOLE * points,
        foot_of_point=geometry.foot_of_point,
        left=left,
        level=np.ascontiguousarray(turn),
        home=robot.home_qpos,
    )


def default_cycle(robot: Robot, name: str) -> float:
    """Return the pendulum times that a cycle of a robot's gait takes unless told otherwise."""
    return _bent(robot, PATTERNS[name])[2]


def _bent(robot: Robot, pattern: FlatPattern) -> tuple[float, float, float, float, float]:
    """Height and rate of a robot's walk, and the shares of velocity and haste that its legs can do.

    Returns: m lower than at home, 1/s at which it falls then, pendulum times of a cycle, shares.
    """
    stance = Stance.of(robot)
    com, feet, leg = stance.terms.com[0], stance.terms.foot_position[0], stance.size
    lowered = max(min(pattern.lowered * leg, deepest_bend(robot)), _HIGH * leg)
    omega = math.sqrt(robot.gravity / (com[2] - feet[:, 2].mean() - lowered))
    if pattern.cycle is not None:
        return lowered, omega, pattern.cycle, 1.0, 1.0
    top = pattern.top * math.sqrt(robot.gravity * leg)
    quick = max(swing_time(robot, top, ARRIVED * (1.0 - pattern.double)) * omega, _LEAST)
    step = min(quick, _MOST)
    return lowered, omega, 2.0 * step, step / quick, (_LEAST / step) ** 2
