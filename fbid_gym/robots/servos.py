"""Torque motors in place of servos, and where there is nothing; the servos' gains as data."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.robots.mjcf import listed, moving_joints

_BIAS = mujoco.mjtBias
_DYN = mujoco.mjtDyn
_GAIN = mujoco.mjtGain
_JOINT = mujoco.mjtJoint
_TRANSMISSION = mujoco.mjtTrn

_ON_JOINTS = (_TRANSMISSION.mjTRN_JOINT, _TRANSMISSION.mjTRN_JOINTINPARENT)
_SETPOINT_DYNAMICS = (
    _DYN.mjDYN_NONE,
    _DYN.mjDYN_INTEGRATOR,
    _DYN.mjDYN_FILTER,
    _DYN.mjDYN_FILTEREXACT,
)


class ServoGains(NamedTuple):
    """The gains of a file's servos, felt at the joints; 0 where a joint has none.

    Attributes:
        stiffness: (n,) N·m/rad.
        damping: (n,) N·m·s/rad; the joint's own damping is not in it.
    """

    stiffness: np.ndarray
    damping: np.ndarray


def servo_gains(model: mujoco.MjModel) -> ServoGains | None:
    """Read the gains of a file's servos; None if it has none.

    A servo's force at the joint is gear (gain u + b_0 + b_1 gear q + b_2 gear qdot).
    """
    servos = [a for a in range(model.nu) if is_servo(model, a)]
    if not servos:
        return None
    gains = ServoGains(np.zeros(model.nv - 6), np.zeros(model.nv - 6))
    for a in servos:
        dof = int(model.jnt_dofadr[model.actuator_trnid[a, 0]]) - 6
        gear = float(model.actuator_gear[a, 0])
        gains.stiffness[dof] += -model.actuator_biasprm[a, 1] * gear**2
        gains.damping[dof] += -model.actuator_biasprm[a, 2] * gear**2
    return gains


def is_servo(model: mujoco.MjModel, a: int) -> bool:
    """Whether actuator `a` is a position or velocity servo on a joint of the robot."""
    return (
        _TRANSMISSION(model.actuator_trntype[a]) in _ON_JOINTS
        and model.jnt_type[model.actuator_trnid[a, 0]] != _JOINT.mjJNT_FREE
        and model.actuator_gaintype[a] == _GAIN.mjGAIN_FIXED
        and model.actuator_biastype[a] == _BIAS.mjBIAS_AFFINE
        and _DYN(model.actuator_dyntype[a]) in _SETPOINT_DYNAMICS
    )


_GEAR = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]


def use_motors(
    spec: mujoco.MjSpec, model: mujoco.MjModel, torque_limit: Mapping[str, float]
) -> list[str]:
    """Give the joints torque motors: for servos, for nothing, and as strong as the user says.

    A servo keeps its gear and its force limits. A joint without actuator gets a motor where its
    limit is known: given, or the joint's own `actuatorfrcrange`, which is a URDF's effort. A limit
    that is given replaces those of the file.

    Args:
        spec: the spec to change.
        model: the same, compiled.
        torque_limit: joint name -> N·m (N for slides), of joints that the user spoke of.

    Returns:
        Notes of what was changed.
    """
    actuators = {actuator.id: actuator for actuator in spec.actuators}
    servos = [a for a in range(model.nu) if is_servo(model, a)]
    for a in servos:
        _make_motor(actuators[a])
    driven = {int(model.actuator_trnid[a, 0]): a for a in range(model.nu) if _on_joint(model, a)}
    joints = {joint.id: joint for joint in spec.joints}
    added, limited = [], []
    for j in moving_joints(model):
        name = joints[j].name
        if j not in driven and (name in torque_limit or model.jnt_actfrclimited[j]):
            motor = spec.add_actuator(
                name=f"{name}_motor", trntype=_TRANSMISSION.mjTRN_JOINT, target=name
            )
            _make_motor(motor)
            # The file's defaults are meant for its own.
            motor.gear, motor.forcelimited, motor.forcerange = _GEAR, False, [0.0, 0.0]
            added.append(name)
        elif j in driven and name in torque_limit:
            motor = actuators[driven[j]]
            limited.append(name)
        else:
            continue
        if name in torque_limit:
            unit = 1.0
            if j in driven and driven[j] not in servos:
                unit = float(model.actuator_gainprm[driven[j], 0])
            most = abs(torque_limit[name] / (float(motor.gear[0]) * unit))
            motor.ctrllimited, motor.ctrlrange = True, [-most, most]
            motor.forcelimited = False
            joints[j].actfrclimited = False
    if servos or added:
        _drop_controls_of_keyframes(spec)
    return [
        *[f"Torque motors in place of {len(servos)} servos: see servo_gains."] * bool(servos),
        *_note("Torque motors added", added, model),
        *_note("Torque limits as given", limited, model),
    ]


def _on_joint(model: mujoco.MjModel, a: int) -> bool:
    return _TRANSMISSION(model.actuator_trntype[a]) in _ON_JOINTS


def _make_motor(actuator: mujoco.MjsActuator) -> None:
    actuator.set_to_motor()
    actuator.ctrllimited, actuator.ctrlrange = False, [0.0, 0.0]
    actuator.actlimited, actuator.inheritrange = False, 0.0


def _drop_controls_of_keyframes(spec: mujoco.MjSpec) -> None:
    """What a keyframe says of controls was meant for the servos, and counts actuators."""
    for key in spec.keys:
        key.ctrl, key.act = [], []


def _note(change: str, joints: Sequence[str], model: mujoco.MjModel) -> list[str]:
    if not joints:
        return []
    every = len(joints) == len(moving_joints(model))
    return [f"{change} on {'all joints' if every else listed(joints)}."]
