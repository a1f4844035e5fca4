"""Dynamically similar robots: the same motions at another size, in proportionate time.

Lengths are multiplied by s, masses by s^3 and perhaps a density, gravity stays. Then times go with
sqrt(s), forces with masses and torques with masses times s, and nothing that a robot does may tell
its size. Neither may where in its body the base has its origin, nor how its axes lie in it.
"""

import mujoco
import numpy as np

from fbid_gym.robots import Robot
from fbid_gym.robots.built_in import BUILT_IN, asset_path


def similar(name: str, size: float, density: float = 1.0) -> Robot:
    """A built-in robot, `size` times as long, and of so many times the density."""
    own, heavy = BUILT_IN[name], density * size**3
    spec, time = mujoco.MjSpec.from_file(str(asset_path(own.asset))), np.sqrt(size)
    spec.option.timestep *= time
    for body in spec.bodies:
        _multiply(body, size, "pos", "ipos")
        body.mass *= heavy
        _multiply(body, heavy * size**2, "inertia", "fullinertia")
    for geom in spec.geoms:
        if geom.type != mujoco.mjtGeom.mjGEOM_PLANE:
            _multiply(geom, size, "pos", "size", "fromto")
            geom.mass *= heavy
        _soften(geom, size)
    for site in spec.sites:
        _multiply(site, size, "pos", "size", "fromto")
    for joint in spec.joints:
        _multiply(joint, size, "pos")
        # N·m/(rad/s) and N·m/rad, as every joint but the base's turns.
        joint.damping *= heavy * size * time
        joint.stiffness *= heavy * size
        joint.armature *= heavy * size**2
        joint.frictionloss *= heavy * size
    for actuator in spec.actuators:
        _multiply(actuator, heavy * size, "ctrlrange", "forcerange")
    return Robot.from_mjcf(spec, own.feet, name=f"{name} x {size:g}", home=own.home)


def moved(name: str, *origin: float) -> Robot:
    """A built-in robot whose base has its origin elsewhere: x, y, z (m) from where it was."""
    own, way = BUILT_IN[name], np.array(origin)
    spec, base = _with_base(own.asset)
    base.ipos = base.ipos - way
    for part in (*base.bodies, *base.geoms, *base.sites):
        if hasattr(part, "fromto") and np.isfinite(part.fromto[0]):
            part.fromto = part.fromto - np.tile(way, 2)
        else:
            part.pos = part.pos - way
    return Robot.from_mjcf(spec, own.feet, name=f"{name} moved", home=own.home)


def turned(
    name: str, axis: tuple[float, float, float], angle: float, *, as_drawn: bool = True
) -> Robot:
    """A built-in robot whose base has other axes: those from before turned by an angle (rad).

    Or, not as it was drawn, the robot turned with them.
    """
    own, turn, back, ipos = BUILT_IN[name], np.empty(4), np.empty(4), np.empty(3)
    mujoco.mju_axisAngle2Quat(turn, np.array(axis), angle)
    mujoco.mju_negQuat(back, turn)
    spec, base = _with_base(own.asset)
    base.quat = turn
    if as_drawn:
        as_before = base.add_frame(quat=back)
        for part in (*base.bodies, *base.geoms, *base.sites, *base.cameras, *base.lights):
            part.set_frame(as_before)
        mujoco.mju_rotVecQuat(ipos, base.ipos, back)
        base.ipos, base.iquat = ipos, back
    return Robot.from_mjcf(spec, own.feet, name=f"{name} turned", home=own.home)


def _with_base(asset: str) -> tuple[mujoco.MjSpec, mujoco.MjsBody]:
    """The model, and its body with the free joint."""
    spec = mujoco.MjSpec.from_file(str(asset_path(asset)))
    (root,) = (j for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_FREE)
    return spec, root.parent


def _multiply(element: object, factor: float, *attributes: str) -> None:
    for attribute in attributes:
        setattr(element, attribute, factor * np.asarray(getattr(element, attribute)))


def _soften(geom: mujoco.MjsGeom, size: float) -> None:
    """Contacts that give way in proportion: their time constant and their depth."""
    geom.solref = geom.solref * [np.sqrt(size), 1.0]
    geom.solimp = geom.solimp * [1.0, 1.0, size, 1.0, 1.0]
    geom.margin *= size
    geom.gap *= size
