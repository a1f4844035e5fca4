"""Places of a robot's feet as seen from its inertial unit, by its joint angles.

Each leg is a product of exponentials (Brockett 1984): the joints' axes in the posture of zeros, and
what hangs at their end. So it holds for hinges and slides in any order, and for any robot.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.dynamics.vectors import (
    Rotation,
    Vector,
    add,
    cross,
    product,
    scale,
    store,
    subtract,
    turn,
    vector,
)
from fbid_gym.robots import Robot
from fbid_gym.robots.measured_model import MeasuredModel

SITE = "imu"
"""Name of the site of the base where the inertial unit sits, with its axes."""


class Mounting(NamedTuple):
    """Pose of the inertial unit on the trunk."""

    place: np.ndarray  # (3,) m, of the unit, in the base's frame
    base_from_imu: np.ndarray  # (3, 3)
    ahead: np.ndarray  # (3,) the trunk's direction ahead, in the unit's frame


class Legs(NamedTuple):
    """The legs of a robot with F feet, at most K joints to each; in the frame of the unit.

    In the posture in which all joint coordinates are zero.
    """

    joint: np.ndarray  # (F, K) int64, joints from the base to the foot; -1 beyond the last
    hinge: np.ndarray  # (F, K) bool, whether it turns, and does not slide
    axis: np.ndarray  # (F, K, 3)
    anchor: np.ndarray  # (F, K, 3) m, a point on it
    foot: np.ndarray  # (F, 3) m, centre of the foot's points
    radius: np.ndarray  # (F,) m, by which that centre lies above the ground


def mounting_of(robot: Robot) -> tuple[Mounting, str]:
    """Return where a robot's inertial unit sits, and a note in words if its model does not say."""
    model, trunk = robot.model, base_from_trunk(robot)
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, SITE)
    if site >= 0 and model.site_bodyid[site] == robot.base_body:
        pose = MeasuredModel(model, model.qpos0)
        data, base = pose.data, pose.rotation(robot.base_body)
        place = base.T @ (data.site_xpos[site] - data.xpos[robot.base_body])
        axes = base.T @ data.site_xmat[site].reshape(3, 3)
        return Mounting(place, axes, axes.T @ trunk[:, 0]), ""
    note = (
        f"{robot.name} has no site {SITE!r} on its base: the inertial unit is taken to sit at the "
        "base's origin, with the trunk's axes."
    )
    return Mounting(np.zeros(3), trunk, np.array([1.0, 0.0, 0.0])), note


def legs_of(robot: Robot, mounting: Mounting) -> Legs:
    """Measure a robot's legs."""
    zeros = np.array([0.0, 0.0, 0.0, 1.0, *np.zeros(robot.nq - 4)])
    model, pose = robot.model, MeasuredModel(robot.model, zeros)
    data, base = pose.data, pose.rotation(robot.base_body)
    to_imu = mounting.base_from_imu.T @ base.T
    place = data.xpos[robot.base_body] + base @ mounting.place
    chains = [pose.joints_above(foot.body) for foot in robot.feet]
    shape = len(chains), max(1, *map(len, chains))
    legs = Legs(
        joint=np.full(shape, -1, np.int64),
        hinge=np.zeros(shape, bool),
        axis=np.zeros((*shape, 3)),
        anchor=np.zeros((*shape, 3)),
        foot=np.zeros((len(chains), 3)),
        radius=np.array([float(foot.radius) for foot in robot.feet]),
    )
    for i, (chain, foot) in enumerate(zip(chains, robot.feet, strict=True)):
        for k, joint in enumerate(chain):
            legs.joint[i, k] = model.jnt_dofadr[joint] - 6
            legs.hinge[i, k] = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
            legs.axis[i, k] = to_imu @ data.xaxis[joint]
            legs.anchor[i, k] = to_imu @ (data.xanchor[joint] - place)
        centre = data.xpos[foot.body] + pose.rotation(foot.body) @ foot.points.mean(axis=0)
        legs.foot[i] = to_imu @ (centre - place)
    return legs


@compiled
def turning(axis: Vector) -> Rotation:
    """Return the rotation by a vector: rad, about its direction (Rodrigues)."""
    angle = np.sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2])
    if angle < 1e-8:
        sine, versine = 1.0, 0.5
    else:
        sine, versine = np.sin(angle) / angle, (1.0 - np.cos(angle)) / (angle * angle)
    x, y, z = axis
    return (
        (1.0 - versine * (y * y + z * z), versine * x * y - sine * z, versine * x * z + sine * y),
        (versine * x * y + sine * z, 1.0 - versine * (x * x + z * z), versine * y * z - sine * x),
        (versine * x * z - sine * y, versine * y * z + sine * x, 1.0 - versine * (x * x + y * y)),
    )


@compiled
def place_foot(
    legs: Legs, foot: int, angle: np.ndarray, rate: np.ndarray, axis: np.ndarray, arm: np.ndarray
) -> tuple[Vector, Vector]:
    """Return a foot's centre, and its angular velocity against the unit, in the unit's frame.

    Args:
        legs: of the robot.
        foot: which.
        angle: (n,) rad, of the joints.
        rate: (n,) rad/s.
        axis: (K, 3) buffer; written: the axes of the leg's joints as they lie now.
        arm: (K, 3) buffer; written: the columns of the Jacobian of the foot's centre.
    """
    rotation: Rotation = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    shift: Vector = (0.0, 0.0, 0.0)
    spin: Vector = (0.0, 0.0, 0.0)
    count = legs.joint.shape[1]
    for k in range(count):
        joint = legs.joint[foot, k]
        if joint >= 0:
            own, point = vector(legs.axis, (foot, k)), vector(legs.anchor, (foot, k))
            now = turn(rotation, own)
            store(now, axis, (k,))
            store(add(turn(rotation, point), shift), arm, (k,))
            if legs.hinge[foot, k]:
                about = turning(scale(angle[joint], own))
                shift = add(turn(rotation, subtract(point, turn(about, point))), shift)
                rotation = product(rotation, about)
                spin = add(spin, scale(rate[joint], now))
            else:
                shift = add(shift, scale(angle[joint], now))
    centre = add(turn(rotation, vector(legs.foot, (foot,))), shift)
    for k in range(count):
        if legs.joint[foot, k] >= 0:
            along = vector(axis, (k,))
            if legs.hinge[foot, k]:
                along = cross(along, subtract(centre, vector(arm, (k,))))
            store(along, arm, (k,))
    return centre, spin
