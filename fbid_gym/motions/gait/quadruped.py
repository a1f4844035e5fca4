"""The gaits of four point feet: constants, from measurements of the model, and memory."""

import math
from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import RobotError
from fbid_gym.motions.gait.command import Trim
from fbid_gym.motions.gait.schedule import PATTERNS, Schedule, schedule_of
from fbid_gym.motions.gait.slope import Sense, level_moments
from fbid_gym.motions.gait.touchdown import STANCE
from fbid_gym.robots import Robot
from fbid_gym.robots.measured import once_for_robot
from fbid_gym.robots.polygon import margin_within


class PointFootGait(NamedTuple):
    """A gait on point feet; constants, which `quadruped_gait` makes for a robot. F feet."""

    schedule: Schedule  # of the feet
    sense: Sense  # of the ground
    omega: float  # 1/s, rate at which the robot falls, sqrt(gravity / height of the centre of mass)
    capture: float  # share of an error of velocity that one step takes away
    agility: np.ndarray  # (3,) m/s^2, m/s^2 and rad/s^2, greatest rates of the commanded velocity
    trim: Trim  # of the velocity
    rest: float  # m/s below which a robot is at rest
    astray: float  # m between feet and their places below which a robot may stand still
    # m, distance of the capture point from the middle of the feet at which a robot that stands has
    # to step.
    margin: float
    height: float  # m, of the base above the ground below it
    bend: float  # m/s with which the base is lowered, or raised again
    lift: float  # m that a foot is lifted above the higher end of its step
    sink: float  # m/s with which a foot reaches for the ground
    touch: float  # N on a foot that count as contact
    unload: float  # s in which a foot gives up its load, or takes it
    # (F, 2) m, of each foot from the base, ahead and to the left: as at home, but with the middle
    # of the feet below the centre of mass.
    place: np.ndarray
    hip: np.ndarray  # (F, 3) m, of each hip from the base at home, ahead, to the left and up
    reach: np.ndarray  # (F,) m, greatest distance of a foothold from its hip
    foot_of_point: np.ndarray  # (P,) int64
    home: np.ndarray  # (nq,) of the robot


class PointGaitMemory(NamedTuple):
    """Memory of gaits from tick to tick."""

    phase: np.ndarray  # (N,) of the schedule
    walking: np.ndarray  # (N,) bool, whether feet may lift
    settled: np.ndarray  # (N,) share to which a robot that stands is held over its feet
    velocity: np.ndarray  # (N, 3) m/s, m/s, rad/s: the command as it is followed
    trim: np.ndarray  # (N, 2) m/s, integral of the error, added to the command
    heading: np.ndarray  # (N,) rad, integral of the rate that is followed
    touched: np.ndarray  # (N, F, 3) m, where each foot stands or last stood
    moments: np.ndarray  # (N, 5) m^2, of these places, see `slope.feel_ground`
    mode: np.ndarray  # (N, F) int64, of each foot: `STANCE`, `SWING` or `REACH`
    clock: np.ndarray  # (N, F) s since a foot has begun to reach
    begun: np.ndarray  # (N, F, 3) m, where a foot lifted, or began to reach
    load: np.ndarray  # (N, F) share of its greatest force that a foot may take
    lowered: np.ndarray  # (N,) m by which the base is lower than the gait has it

    @classmethod
    def standing(cls, heading: np.ndarray, foot_position: np.ndarray) -> "PointGaitMemory":
        """Return the memory of robots that stand, with headings (N,) rad and feet at (N, F, 3) m.

        The ground below them is taken to be level until they have stood on it for a while.
        """
        feet = foot_position.shape[:2]
        return cls(
            phase=np.zeros(len(heading)),
            walking=np.zeros(len(heading), bool),
            settled=np.ones(len(heading)),
            velocity=np.zeros((len(heading), 3)),
            trim=np.zeros((len(heading), 2)),
            heading=np.array(heading, dtype=float),
            touched=np.array(foot_position, dtype=float),
            moments=level_moments(foot_position),
            mode=np.full(feet, STANCE),
            clock=np.zeros(feet),
            begun=np.array(foot_position, dtype=float),
            load=np.ones(feet),
            lowered=np.zeros(len(heading)),
        )


# In units of the robot: of the pendulum time sqrt(h / g), the height h of the centre of mass, the
# speed sqrt(g h), gravity g and the weight.
_AGILITY = 0.4  # of gravity
_REST = 0.1  # of the speed
_ASTRAY = 0.25  # of the height
_MARGIN = 0.5  # of the way to the edge of the feet
_SINK = 1.0
_BEND = 0.1  # of the speed
_TOUCH = 0.01
_REACH = 0.95  # of the stretched leg
_FELT = 0.25  # cycles over which the ground is felt
_LEVEL = 0.02  # of the mean square distance of the feet from their middle
_BENT = 0.7  # of the stretched leg: a robot that walks has its hips no higher

_SAMPLES = 2000


def quadruped_gait(
    robot: Robot, gait: str = "trot", integral_time: float = 0.0, period: float | None = None
) -> PointFootGait:
    """Return a gait, one of `schedule.PATTERNS`, of a robot with four point feet.

    Errors of the velocity last, or are made up for in an `integral_time`, see `Trim`. A cycle takes
    a `period`, see `schedule_of`.

    Raises:
        UnknownOptionError: no such gait.
        RobotError: the robot has not one foot at each corner, or one with several points.
    """
    schedule, pattern = schedule_of(robot, gait, period), PATTERNS[gait]
    broad = [foot.name for foot in robot.feet if foot.num_points > 1]
    if broad:
        raise RobotError(
            f"Foot {broad[0]!r} of {robot.name!r} has several contact points. "
            "Expected point feet to walk on four of them."
        )
    stance, gravity = Stance.of(robot), robot.gravity
    hips, lengths = stance.hips, _leg_lengths(robot)
    base, feet = stance.terms.base_position[0], stance.terms.foot_position[0]
    drop = max(0.0, float(np.max(hips[:, 2] - feet[:, 2] - _BENT * lengths)))
    height = float(stance.home_com[2]) - drop
    time, speed = math.sqrt(height / gravity), math.sqrt(height * gravity)
    # Around the point below the centre of mass, where at home that is not their middle.
    place = (feet - base + stance.home_com)[:, :2]
    return PointFootGait(
        schedule=schedule,
        sense=Sense(_FELT * schedule.period, _LEVEL * float(place.var(axis=0).mean())),
        omega=1.0 / time,
        capture=pattern.capture,
        agility=_AGILITY * gravity / np.array([1.0, 1.0, stance.length]),
        trim=Trim.of(integral_time, 1.0 / time, gravity),
        rest=_REST * speed,
        astray=_ASTRAY * height,
        margin=_MARGIN * float(stance.margin.min()),
        height=float(stance.home_base[2]) - drop,
        bend=_BEND * speed,
        lift=pattern.clearance * height,
        sink=_SINK * speed,
        touch=_TOUCH * robot.weight,
        unload=pattern.unload * time,
        place=np.ascontiguousarray(place),
        hip=hips - base,
        reach=_REACH * lengths,
        foot_of_point=stance.geometry.foot_of_point,
        home=robot.home_qpos,
    )


def least_friction(robot: Robot, gait: PointFootGait) -> float:
    """Return the coefficient of friction that carries a robot without a moment all the time.

    Where the feet that stand are not around the centre of mass, forces on them have to lean.
    """
    leaning = 0.0
    for phase in gait.schedule.lift:
        stands = (phase - gait.schedule.lift) % 1.0 >= 1.0 - gait.schedule.duty
        if stands.any():
            leaning = max(leaning, -margin_within(gait.place[stands], np.zeros(2)))
    return leaning * gait.omega**2 / robot.gravity


@once_for_robot
def _leg_lengths(robot: Robot) -> np.ndarray:
    """Farthest that each foot gets from its hip, of many postures within the ranges: (F,) m.

    All legs take the same postures. Measured once for each robot, as it takes so long.
    """
    model, rng = robot.model, np.random.default_rng(0)
    own, data = Stance.of(robot).legs, mujoco.MjData(model)
    data.qpos[:] = robot.home_qpos
    along = (np.cumsum(own, axis=1) * own).max(axis=0)  # which joint of its leg, from 1
    joints = [int(model.dof_jntid[6 + np.argmax(leg)]) for leg in own]
    low, high = np.clip(robot.joint_range, -np.pi, np.pi).T
    lengths = np.zeros(robot.num_feet)
    for _ in range(_SAMPLES):
        data.qpos[7:] = low + rng.uniform(size=robot.num_joints + 1)[along] * (high - low)
        mujoco.mj_kinematics(model, data)
        for foot, (part, joint) in enumerate(zip(robot.feet, joints, strict=True)):
            centre = data.xpos[part.body] + data.xmat[part.body].reshape(3, 3) @ part.points[0]
            lengths[foot] = max(lengths[foot], np.linalg.norm(centre - data.xanchor[joint]))
    lengths.flags.writeable = False
    return lengths
