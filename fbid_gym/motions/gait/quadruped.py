"""The gaits of four point feet, from measurements of the robot's model."""

import math

import mujoco
import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import RobotError
from fbid_gym.motions.gait.command import Trim
from fbid_gym.motions.gait.point_gait import PointFootGait
from fbid_gym.motions.gait.schedule import PATTERNS, schedule_of
from fbid_gym.motions.gait.slope import Sense
from fbid_gym.robots import Robot
from fbid_gym.robots.measured import once_for_robot

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
