"""The torque motors of a robot: one on every joint, so that S = [0 I] in [M10] eq. (2).

Where a file has servos, or nothing, motors take their place; the servos' gains are kept as data.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.mjcf import listed, moving_joints, object_name, object_names, refuse

_BIAS = mujoco.mjtBias
_DYN = mujoco.mjtDyn
_GAIN = mujoco.mjtGain
_JOINT = mujoco.mjtJoint
_OBJ = mujoco.mjtObj
_TRANSMISSION = mujoco.mjtTrn

_ON_JOINTS = (_TRANSMISSION.mjTRN_JOINT, _TRANSMISSION.mjTRN_JOINTINPARENT)
_SETPOINT_DYNAMICS = (
    *(_DYN.mjDYN_NONE, _DYN.mjDYN_INTEGRATOR),
    *(_DYN.mjDYN_FILTER, _DYN.mjDYN_FILTEREXACT),
)
_GEAR = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]


class ServoGains(NamedTuple):
    """The gains of a file's servos, felt at the joints; 0 where a joint has none."""

    stiffness: np.ndarray  # (n,) N·m/rad
    damping: np.ndarray  # (n,) N·m·s/rad; the joint's own damping is not in it


def servo_gains(model: mujoco.MjModel) -> ServoGains | None:
    """Read the gains of a file's servos; None if it has none.

    A servo's force at the joint is gear (gain u + b_0 + b_1 gear q + b_2 gear qdot).
    """
    servos = _servos(model)
    if not servos:
        return None
    gains, dofs = np.zeros((2, model.nv - 6)), model.jnt_dofadr[model.actuator_trnid[servos, 0]] - 6
    by_position, by_velocity = model.actuator_biasprm[servos, 1:3].T
    np.add.at(gains[0], dofs, -by_position * model.actuator_gear[servos, 0] ** 2)
    np.add.at(gains[1], dofs, -by_velocity * model.actuator_gear[servos, 0] ** 2)
    return ServoGains(*gains)


def set_armature(spec: mujoco.MjSpec, armature: Mapping[str, float]) -> list[str]:
    """Set joints' armature, kg·m² (kg for slides); returns notes."""
    for joint in spec.joints:
        joint.armature = armature.get(joint.name, joint.armature)
    return [f"Armature as given on {listed(armature)}."] if armature else []


def use_motors(
    spec: mujoco.MjSpec, model: mujoco.MjModel, torque_limit: Mapping[str, float]
) -> list[str]:
    """Give the joints torque motors: for servos, for nothing, and as strong as the user says.

    A servo keeps its gear and its force limits. A joint without actuator gets a motor where its
    limit is known: given, or the joint's own `actuatorfrcrange`, which is a URDF's effort. Limits
    in `torque_limit`, N·m (N for slides), replace those of the file. Changes the spec, of which
    `model` is the compilation. Returns notes of what was changed.
    """
    actuators = {actuator.id: actuator for actuator in spec.actuators}
    servos = _servos(model)
    for a in servos:
        _make_motor(actuators[a])
    driven = {int(model.actuator_trnid[a, 0]): a for a in range(model.nu) if _on_joint(model, a)}
    joints = {joint.id: joint for joint in spec.joints}
    added = list[str]()
    for j in moving_joints(model):
        name, unit = joints[j].name, 1.0
        if j in driven:
            motor = actuators[driven[j]]
            unit = 1.0 if driven[j] in servos else float(model.actuator_gainprm[driven[j], 0])
        elif name in torque_limit or model.jnt_actfrclimited[j]:
            target = {"trntype": _TRANSMISSION.mjTRN_JOINT, "target": name}
            motor = spec.add_actuator(name=f"{name}_motor", **target)
            _make_motor(motor)
            # The file's defaults are meant for its own.
            motor.gear, motor.forcelimited, motor.forcerange = _GEAR, False, [0.0, 0.0]
            added.append(name)
        if name in torque_limit:
            most = abs(torque_limit[name] / (float(motor.gear[0]) * unit))
            motor.ctrllimited, motor.ctrlrange = True, [-most, most]
            motor.forcelimited = joints[j].actfrclimited = False
    given = [joints[j].name for j in sorted(driven) if joints[j].name in torque_limit]
    if servos or added:
        # What a keyframe says of controls was meant for the servos, and counts actuators.
        for key in spec.keys:
            key.ctrl, key.act = [], []
    return [
        *[f"Torque motors in place of {len(servos)} servos: see servo_gains."] * bool(servos),
        *_note("Torque motors added", added, model),
        *_note("Torque limits as given", given, model),
    ]


def motor_of_each_joint(model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return joints' actuators (n,), their torques per unit of ctrl, and limits, N·m (N of slides).

    The limit is the smallest magnitude among gear * ctrlrange, gear * forcerange and the joint's
    actuatorfrcrange. An asymmetric range counts by its smaller side: a controller that keeps to a
    symmetric limit then never saturates, at the price of the stronger side's excess.

    Raises RobotError for a joint without or with several actuators, an actuator that is not a plain
    torque motor, or a motor without a finite, two-sided limit.
    """
    for a in range(model.nu):
        reason = _not_a_motor(model, a)
        if reason:
            raise RobotError(
                f"Actuator {object_name(model, _OBJ.mjOBJ_ACTUATOR, a)!r} {reason}. "
                "Expected plain torque motors (<motor joint=... ctrlrange=...>), or servos."
            )
    joints, driven = moving_joints(model), model.actuator_trnid[:, 0]
    refuse(
        *(model, _OBJ.mjOBJ_JOINT, [j for j in joints if j not in driven]),
        "Joints without an actuator: {}. Expected one motor per joint. One is "
        "added where torque_limit= says how strong (N·m, by the joint's name or a pattern).",
    )
    for j in joints:
        names = object_names(model, _OBJ.mjOBJ_ACTUATOR, np.flatnonzero(driven == j))
        if len(names) > 1:
            raise RobotError(
                f"Joint {object_name(model, _OBJ.mjOBJ_JOINT, j)!r} has {len(names)} actuators: "
                f"{listed(names)}. Expected one motor per joint."
            )
    actuator = np.argsort(driven).astype(int)  # joints' ids are in dof order
    gear = model.actuator_gear[actuator, 0] * model.actuator_gainprm[actuator, 0]
    limit = [_torque_limit(model, a, j) for a, j in zip(actuator, joints, strict=True)]
    return actuator, gear, np.array(limit, dtype=float)


def _servos(model: mujoco.MjModel) -> list[int]:
    """Ids of the position and velocity servos on joints of the robot."""
    return [
        a
        for a in range(model.nu)
        if _on_joint(model, a)
        and model.jnt_type[model.actuator_trnid[a, 0]] != _JOINT.mjJNT_FREE
        and model.actuator_gaintype[a] == _GAIN.mjGAIN_FIXED
        and model.actuator_biastype[a] == _BIAS.mjBIAS_AFFINE
        and _DYN(model.actuator_dyntype[a]) in _SETPOINT_DYNAMICS
    ]


def _on_joint(model: mujoco.MjModel, a: int) -> bool:
    return _TRANSMISSION(model.actuator_trntype[a]) in _ON_JOINTS


def _not_a_motor(model: mujoco.MjModel, a: int) -> str:
    """Say why actuator `a` is not a plain torque motor; an empty string if it is one."""
    if not _on_joint(model, a):
        kind = _TRANSMISSION(model.actuator_trntype[a]).name.removeprefix("mjTRN_").lower()
        return f"acts on a {kind}, not on a joint"
    if model.jnt_type[model.actuator_trnid[a, 0]] == _JOINT.mjJNT_FREE:
        return "acts on the free joint of the base"
    if model.actuator_dyntype[a] != _DYN.mjDYN_NONE:
        return "has activation dynamics"
    plain = _GAIN.mjGAIN_FIXED, _BIAS.mjBIAS_NONE
    if (model.actuator_gaintype[a], model.actuator_biastype[a]) != plain:
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
    gear, name = model.actuator_gear[a, 0], object_name(model, _OBJ.mjOBJ_ACTUATOR, a)
    unit = gear * model.actuator_gainprm[a, 0]
    known = (
        (model.actuator_ctrllimited[a], unit * model.actuator_ctrlrange[a]),
        (model.actuator_forcelimited[a], gear * model.actuator_forcerange[a]),
        (model.jnt_actfrclimited[j], model.jnt_actfrcrange[j]),
    )
    ranges = [torques for limited, torques in known if limited]
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


def _make_motor(actuator: mujoco.MjsActuator) -> None:
    actuator.set_to_motor()
    actuator.ctrllimited, actuator.ctrlrange = False, [0.0, 0.0]
    actuator.actlimited, actuator.inheritrange = False, 0.0


def _note(change: str, joints: Sequence[str], model: mujoco.MjModel) -> list[str]:
    if not joints:
        return []
    every = len(joints) == len(moving_joints(model))
    return [f"{change} on {'all joints' if every else listed(joints)}."]
