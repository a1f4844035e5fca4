"""The mirror symmetry of a robot: what its left does, its right can.

Found from the model in its home pose, reflected in the plane ahead and up through its base: places
and axes of the joints, their ranges, limits and losses, masses and inertias, and contact points.
Names decide nothing.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.measured import once_for_robot
from fbid_gym.robots.robot import Robot

# By how much mirrored parts may differ: in heights of the centre of mass, masses of the robot,
# radians, or of one.
_ALIKE = 0.01
# What reflection does to a vector; to a rotation's it does the opposite.
_ACROSS = np.array([1.0, -1.0, 1.0])


class Reflection(NamedTuple):
    """Permutation and signs by which a row of numbers is mirrored."""

    entry: np.ndarray  # (K,) index of the number that takes each place
    sign: np.ndarray  # (K,) 1 or -1, of which it is multiplied

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return numbers (..., K) in the mirror; twice, they are what they were."""
        return values[..., self.entry] * self.sign


class Mirror(NamedTuple):
    """The mirror symmetry of a robot."""

    joints: Reflection  # of what they do, counted from home: positions, velocities, torques
    feet: Reflection  # of what they have, such as loads
    points: Reflection  # of what contact points have


@once_for_robot
def mirror_of(robot: Robot) -> Mirror:
    """Return the mirror symmetry of a robot, or raise RobotError for a part without counterpart."""
    data, n = robot.at_home.data, robot.num_joints
    base, size = data.xpos[robot.base_body], float(robot.at_home.com[2])
    axes = robot.at_home.rotation(robot.base_body)
    if not np.allclose(axes.T * _ACROSS @ axes, np.diag(_ACROSS), atol=_ALIKE):
        raise _none(robot, "its base does not look ahead along its x axis at home")
    hinge = robot.model.jnt_type[1 : n + 1] == mujoco.mjtJoint.mjJNT_HINGE
    axis = data.xaxis[1 : n + 1]
    place = (data.xanchor[1 : n + 1] - base) / size
    swapped = np.where(hinge[:, None], -axis, axis) * _ACROSS @ axis.T
    apart = np.linalg.norm((place * _ACROSS)[:, None] - place, axis=2) + 1.0 - np.abs(swapped)
    apart[hinge[:, None] != hinge] = np.inf
    joint = _partners(robot, apart, [f"joint {name!r}" for name in robot.joint_names])
    joints = Reflection(joint, np.sign(swapped[np.arange(n), joint]))
    _check_joints(robot, joints)
    _check_links(robot, joint)

    touches = (robot.points_at_home - base * [1.0, 1.0, 0.0]) / size
    apart = np.linalg.norm((touches * _ACROSS)[:, None] - touches, axis=2)
    point = _partners(robot, apart, [f"contact point {k}" for k in range(len(touches))])
    foot_of = np.repeat(np.arange(robot.num_feet), [foot.num_points for foot in robot.feet])
    foot = np.array([foot_of[point[foot_of == k][0]] for k in range(robot.num_feet)])
    feet, points = (Reflection(entry, np.ones(len(entry))) for entry in (foot, point))
    return Mirror(joints, feet, points)


def _partners(robot: Robot, apart: np.ndarray, names: list[str]) -> np.ndarray:
    """Return which part is the counterpart of which, from how far apart they are in the mirror."""
    partner = apart.argmin(axis=1)
    for k, name in enumerate(names):
        if apart[k, partner[k]] > _ALIKE or partner[partner[k]] != k:
            raise _none(robot, f"{name} has no counterpart")
    return partner


def _check_joints(robot: Robot, joints: Reflection) -> None:
    """Raise RobotError where joints differ from their counterparts in what they can do."""
    model, home = robot.model, robot.home_qpos[7:]
    lower, upper = (robot.joint_range - home[:, None]).T
    flipped = joints.sign < 0.0
    limit = robot.torque_limit
    alike = {
        "lower end of its range": (lower, np.where(flipped, -upper, lower)),
        "upper end of its range": (upper, np.where(flipped, -lower, upper)),
        "torque limit": (limit / limit.max(), limit / limit.max()),
        "armature": (model.dof_armature[6:],) * 2,
        "damping": (model.dof_damping[6:],) * 2,
        "friction": (model.dof_frictionloss[6:],) * 2,
    }
    for what, (own, other) in alike.items():
        close = np.isclose(own, other[joints.entry], atol=_ALIKE, rtol=_ALIKE)
        for k in np.flatnonzero(~close)[:1]:
            name = robot.joint_names[k]
            raise _none(robot, f"joint {name!r} has another {what} than its counterpart")


def _check_links(robot: Robot, joint: np.ndarray) -> None:
    """Raise RobotError where what joints move differs from its counterpart in mass or inertia."""
    model, size = robot.model, float(robot.at_home.com[2])
    moved = model.body_weldid[model.jnt_bodyid[1 : robot.num_joints + 1]]
    pairs = [(robot.base_body, robot.base_body), *zip(moved, moved[joint], strict=True)]
    for one, other in pairs:
        masses = zip(_moments(robot, one, _ACROSS), _moments(robot, other), strict=True)
        for power, (own, its) in enumerate(masses):
            if np.abs(own - its).max() > _ALIKE * robot.mass * size**power:
                what = ("mass", "centre of mass", "inertia")[power]
                name = robot.at_home.body_name(one)
                raise _none(robot, f"body {name!r} has another {what} than its counterpart")


def _moments(robot: Robot, link: int, scale: np.ndarray | float = 1.0) -> tuple[np.ndarray, ...]:
    """Return mass, first and second moments about the base of a rigid link, scaled along axes."""
    model, data = robot.model, robot.at_home.data
    mass, first, second = np.zeros(()), np.zeros(3), np.zeros((3, 3))
    for body in np.flatnonzero(model.body_weldid == model.body_weldid[link]):
        turned = data.ximat[body].reshape(3, 3)
        place, inertia = data.xipos[body] - data.xpos[robot.base_body], model.body_inertia[body]
        spread = turned * (0.5 * inertia.sum() - inertia) @ turned.T
        mass = mass + model.body_mass[body]
        first = first + model.body_mass[body] * place
        second = second + spread + model.body_mass[body] * np.outer(place, place)
    return mass, first * scale, second * np.outer(scale, scale)


def _none(robot: Robot, why: str) -> RobotError:
    return RobotError(
        f"Robot {robot.name!r} has no mirror symmetry: {why}. Expected one whose left is as its "
        "right in its home pose."
    )
