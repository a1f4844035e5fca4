"""Joints of a spec that cannot move: taken, and what hangs from them left in its place."""

from collections.abc import Mapping
from contextlib import suppress
from xml.etree import ElementTree

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.mjcf import listed, object_names
from fbid_gym.robots.touching import bodies_of_feet

_JOINT = mujoco.mjtJoint


def lock_equal_limits(spec: mujoco.MjSpec, model: mujoco.MjModel, urdf: bytes) -> list[str]:
    """Lock joints whose lower and upper limit are one; returns notes.

    MuJoCo ignores these limits. Of an MJCF those are given that are not 0.
    """
    named = {joint.name: joint.range for joint in spec.joints if joint.name and joint.limited}
    found = {name: ends[0] for name, ends in named.items() if ends[0] == ends[1] != 0.0}
    with suppress(ElementTree.ParseError, ValueError):  # MuJoCo is less strict
        for joint in ElementTree.fromstring(urdf).iter("joint"):
            limit = joint.find("limit")
            if limit is not None and joint.get("type") in ("revolute", "prismatic"):
                low, high = limit.get("lower"), limit.get("upper")
                if low and high and float(low) == float(high):
                    found[joint.get("name", "")] = float(low)
    locked = {}
    for joint in spec.joints:
        if joint.name in found and joint.type in (_JOINT.mjJNT_HINGE, _JOINT.mjJNT_SLIDE):
            way = found[joint.name] - joint.ref
            turns = joint.type == _JOINT.mjJNT_HINGE and spec.compiler.degree
            locked[joint] = float(np.radians(way) if turns else way)
    return _lock(spec, locked, "whose limits are equal", model)


def lock_tied(spec: mujoco.MjSpec, model: mujoco.MjModel) -> list[str]:
    """Lock joints that an `<equality>` ties to a constant, or to each other where no foot hangs.

    Fingers that follow one another do not walk; legs whose joints do are refused, see `unmodelled`.
    """
    joints = {joint.name: joint for joint in spec.joints}
    legs = _joints_of_legs(model) if model.neq else set()
    tied, ties = dict[mujoco.MjsJoint, float](), list[mujoco.MjsEquality]()
    for tie in spec.equalities:
        ends = [joints[name] for name in (tie.name1, tie.name2) if name in joints]
        is_joint = tie.type == mujoco.mjtEq.mjEQ_JOINT and tie.active and ends
        if is_joint and (len(ends) == 1 or not legs & {joint.name for joint in ends}):
            ties.append(tie)
            tied |= {joint: 0.0 for joint in ends[1:] if joint not in tied}
            tied[ends[0]] = float(tie.data[0])
    for tie in ties:
        spec.delete(tie)
    return _lock(spec, tied, "which an <equality> or <mimic> ties", model)


def leave_out_idle(spec: mujoco.MjSpec, model: mujoco.MjModel) -> list[str]:
    """Weld to the world what hangs there from joints that nothing drives; returns notes."""
    free = np.flatnonzero(model.jnt_type == _JOINT.mjJNT_FREE)
    if len(free) != 1:
        return []
    root = int(model.jnt_bodyid[free[0]])
    outside = np.flatnonzero(model.body_rootid[model.jnt_bodyid] != root).tolist()
    if not outside or np.isin(outside, model.actuator_trnid[:, 0]).any():
        return []
    joints = {joint.id: joint for joint in spec.joints}
    names = object_names(model, mujoco.mjtObj.mjOBJ_JOINT, outside)
    _forget(spec, [joints[j] for j in outside], model)
    return [f"Idle joints beside the robot left out: {listed(names)}."]


def _joints_of_legs(model: mujoco.MjModel) -> set[str]:
    """Names of the joints that feet hang from, as far as they are found; else of all joints."""
    drawn = MeasuredModel(model, model.qpos0)
    every = set(range(model.njnt))
    with suppress(RobotError):
        every = {joint for foot in bodies_of_feet(drawn) for joint in drawn.joints_above(foot)}
    return {model.joint(int(joint)).name for joint in every}


def _lock(
    spec: mujoco.MjSpec, locked: Mapping[mujoco.MjsJoint, float], why: str, model: mujoco.MjModel
) -> list[str]:
    """Take joints, and leave their bodies so far (rad, m) from the reference pose."""
    if not locked:
        return []
    names = [joint.name for joint in locked]
    for joint, value in locked.items():
        _move(joint.parent, joint, value)
    _forget(spec, list(locked), model)
    return [f"Joints locked, {why}: {listed(names)}."]


def _forget(spec: mujoco.MjSpec, joints: list[mujoco.MjsJoint], model: mujoco.MjModel) -> None:
    """Take joints, what acts on them, and their places in keyframes of a spec that is `model`."""
    names = {joint.name for joint in joints}
    gone = np.isin([model.joint(j).name for j in range(model.njnt)], list(names))
    ends = [*model.jnt_qposadr[1:], model.nq]
    kept = np.repeat(~gone, np.subtract(ends, model.jnt_qposadr))
    for key in spec.keys:
        key.qpos = np.array(key.qpos)[kept] if len(key.qpos) == model.nq else []
        key.qvel, key.ctrl, key.act = [], [], []
    acting = [part for part in spec.actuators if part.target in names]
    seeing = [part for part in spec.sensors if part.objname in names]
    for part in (*acting, *seeing, *joints):
        spec.delete(part)


def _move(body: mujoco.MjsBody, joint: mujoco.MjsJoint, by: float) -> None:
    """Move a body as its joint would."""
    turn, quat, way = np.empty(4), np.empty(4), np.empty(3)
    axis = np.asarray(joint.axis, float) / np.linalg.norm(joint.axis)
    if joint.type == _JOINT.mjJNT_SLIDE:
        mujoco.mju_rotVecQuat(way, by * axis, body.quat)
        body.pos = body.pos + way
        return
    mujoco.mju_axisAngle2Quat(turn, axis, by)
    mujoco.mju_rotVecQuat(way, joint.pos, turn)
    shift = joint.pos - way
    mujoco.mju_rotVecQuat(way, shift, body.quat)
    mujoco.mju_mulQuat(quat, body.quat, turn)
    body.pos, body.quat = body.pos + way, quat
