"""The torque motors of a robot: one on every joint, so that S = [0 I] in [M10] eq. (2)."""

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.mjcf import listed, moving_joints, object_name, object_names

_JOINT = mujoco.mjtJoint
_OBJ = mujoco.mjtObj
_TRANSMISSION = mujoco.mjtTrn


def motor_of_each_joint(
    model: mujoco.MjModel,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the torque motor of every joint and its limit.

    The limit is the smallest magnitude among gear * ctrlrange, gear * forcerange and the joint's
    actuatorfrcrange. An asymmetric range counts by its smaller side: a controller that keeps to a
    symmetric limit then never saturates, at the price of the stronger side's excess.

    Returns:
        actuator (n,) ids; gear (n,), torque per unit of ctrl; torque_limit (n,) in N·m (N for
        slides). Joints in dof order, without the base.

    Raises:
        RobotError: a joint without or with several actuators, an actuator that is not a plain
            torque motor, or a motor without a finite, two-sided limit.
    """
    driven: dict[int, list[int]] = {j: [] for j in range(model.njnt)}
    for a in range(model.nu):
        reason = _not_a_motor(model, a)
        if reason:
            raise RobotError(
                f"Actuator {object_name(model, _OBJ.mjOBJ_ACTUATOR, a)!r} {reason}. "
                "Expected plain torque motors (<motor joint=... ctrlrange=...>), or servos."
            )
        driven[int(model.actuator_trnid[a, 0])].append(a)
    joints = moving_joints(model)
    missing = [object_name(model, _OBJ.mjOBJ_JOINT, j) for j in joints if not driven[j]]
    if missing:
        raise RobotError(
            f"Joints without an actuator: {listed(missing)}. Expected one motor per joint. One is "
            "added where torque_limit= says how strong (N·m, by the joint's name or a pattern)."
        )
    for j in joints:
        if len(driven[j]) > 1:
            names = object_names(model, _OBJ.mjOBJ_ACTUATOR, driven[j])
            raise RobotError(
                f"Joint {object_name(model, _OBJ.mjOBJ_JOINT, j)!r} has {len(names)} actuators: "
                f"{listed(names)}. Expected one motor per joint."
            )
    actuator = np.array([driven[j][0] for j in joints], dtype=int)
    gear = model.actuator_gear[actuator, 0] * model.actuator_gainprm[actuator, 0]
    limit = np.array(
        [_torque_limit(model, a, j) for a, j in zip(actuator, joints, strict=True)], dtype=float
    )
    return actuator, gear, limit


def _not_a_motor(model: mujoco.MjModel, a: int) -> str:
    """Say why actuator `a` is not a plain torque motor; an empty string if it is one."""
    transmission = _TRANSMISSION(model.actuator_trntype[a])
    if transmission not in (_TRANSMISSION.mjTRN_JOINT, _TRANSMISSION.mjTRN_JOINTINPARENT):
        kind = transmission.name.removeprefix("mjTRN_").lower()
        return f"acts on a {kind}, not on a joint"
    joint = int(model.actuator_trnid[a, 0])
    if model.jnt_type[joint] == _JOINT.mjJNT_FREE:
        return "acts on the free joint of the base"
    if model.actuator_dyntype[a] != mujoco.mjtDyn.mjDYN_NONE:
        return "has activation dynamics"
    if (
        model.actuator_gaintype[a] != mujoco.mjtGain.mjGAIN_FIXED
        or model.actuator_biastype[a] != mujoco.mjtBias.mjBIAS_NONE
    ):
        return "is a servo: its torque depends on the joint's position or velocity"
    if model.actuator_delay[a] > 0:
        return "delays its control"
    if model.actuator_armature[a] != 0 or model.actuator_damping[a] != 0:
        return "has armature or damping of its own; give them to the joint instead"
    if model.actuator_gear[a, 0] * model.actuator_gainprm[a, 0] == 0:
        return "has gear 0"
    return ""


def _torque_limit(model: mujoco.MjModel, a: int, j: int) -> float:
    """Symmetric torque limit of actuator `a` on joint `j`, N·m. Raises if there is none."""
    gear = model.actuator_gear[a, 0]
    ranges = []
    if model.actuator_ctrllimited[a]:
        ranges.append(gear * model.actuator_gainprm[a, 0] * model.actuator_ctrlrange[a])
    if model.actuator_forcelimited[a]:
        ranges.append(gear * model.actuator_forcerange[a])
    if model.jnt_actfrclimited[j]:
        ranges.append(model.jnt_actfrcrange[j])
    name = object_name(model, _OBJ.mjOBJ_ACTUATOR, a)
    if not ranges:
        raise RobotError(
            f"Motor {name!r} has no torque limit. Give it a ctrlrange or forcerange, or its joint "
            "an actuatorfrcrange, or pass torque_limit= (N·m, by the joint's name or a pattern)."
        )
    low = max(float(np.min(r)) for r in ranges)
    high = min(float(np.max(r)) for r in ranges)
    limit = min(-low, high)
    if not (np.isfinite(limit) and limit > 0):
        raise RobotError(
            f"Motor {name!r} has the torque range [{low:g}, {high:g}]. Expected a finite range on "
            "both sides of 0."
        )
    return limit
