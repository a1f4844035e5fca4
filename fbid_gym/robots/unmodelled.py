"""Refuse parts of a file that no law models, by name.

The laws' equation of motion is that of one floating tree of hinges and slides. It has inertia,
gravity, what velocities make of both, motors, springs, dampers and dry friction of joints, and
contacts of the feet; nothing else.
"""

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.mjcf import listed, object_name, object_names, refuse, warnings_heard

_JOINT = mujoco.mjtJoint
_OBJ = mujoco.mjtObj

# What makes of a tendon more than a length that sensors read.
_ACTING = (
    *("stiffness", "stiffnesspoly", "damping", "dampingpoly"),
    *("frictionloss", "armature", "limited"),
)
_DISABLED = {
    "actuation": mujoco.mjtDisableBit.mjDSBL_ACTUATION,
    "gravity": mujoco.mjtDisableBit.mjDSBL_GRAVITY,
}
_STEPS = 5
_MOST = 1e6  # m, rad, or times what the weight does
_WARN = mujoco.mjtWarning
_BAD = _WARN.mjWARN_INERTIA, _WARN.mjWARN_BADQPOS, _WARN.mjWARN_BADQVEL, _WARN.mjWARN_BADQACC


def refuse_unmodelled(model: mujoco.MjModel) -> int:
    """Refuse all but one floating tree, and forces that laws lack; returns the floating body's id.

    Tendons that only measure are none of these.
    """
    base = _base_of_tree(model)
    _refuse_extremes(model)
    parts = [getattr(model, f"tendon_{name}") for name in _ACTING]
    acting = [t for t in range(model.ntendon) if any(np.any(part[t]) for part in parts)]
    refuse(
        *(model, _OBJ.mjOBJ_TENDON, acting),
        "Tendons that act are not supported: {}. Expected none with stiffness, damping, "
        "frictionloss, armature or a range; joints may have springs and dampers.",
    )
    refuse(
        *(model, _OBJ.mjOBJ_BODY, np.flatnonzero(model.body_gravcomp)),
        "Compensated gravity is not supported: gravcomp of the bodies {}. "
        "Expected bodies that weigh what their mass says.",
    )
    _refuse_options(model.opt)
    return base


def _base_of_tree(model: mujoco.MjModel) -> int:
    """Id of the floating body of a model that is one floating tree of hinges and slides."""
    free = np.flatnonzero(model.jnt_type == _JOINT.mjJNT_FREE)
    if not free.size:
        inside = np.flatnonzero(model.body_parentid[1:] == 0) + 1
        top_level = object_names(model, _OBJ.mjOBJ_BODY, inside)
        raise RobotError(
            "The robot has no free joint, so its base does not float. Add one to the base body, or "
            f"pass base= one of the top-level bodies: {listed(top_level)}."
        )
    refuse(
        *(model, _OBJ.mjOBJ_BODY, model.jnt_bodyid[free] if len(free) > 1 else []),
        f"The file has {len(free)} free joints, on bodies {{}}. Expected exactly one.",
    )
    base = int(model.jnt_bodyid[free[0]])
    refuse(
        *(model, _OBJ.mjOBJ_JOINT, np.flatnonzero(model.jnt_type == _JOINT.mjJNT_BALL)),
        "Ball joints are not supported: {}. Expected hinges and slides only "
        "(three hinges on one body make a ball).",
    )
    floating = object_name(model, _OBJ.mjOBJ_BODY, base)
    refuse(
        *(model, _OBJ.mjOBJ_JOINT, np.flatnonzero(model.body_rootid[model.jnt_bodyid] != base)),
        f"Joints {{}} do not belong to the floating tree of {floating!r}. "
        "Expected one robot and a static world.",
    )
    ties = [_tie(model, int(tie)) for tie in np.flatnonzero(model.eq_active0)]
    if ties:
        raise RobotError(
            f"Equality constraints are not supported: {listed(ties)}. "
            "Expected a tree without closed loops, whose legs' joints move by themselves."
        )
    return base


def _tie(model: mujoco.MjModel, tie: int) -> str:
    """Name of an equality constraint, with that of the parts it ties."""
    kind = mujoco.mjtEq(model.eq_type[tie]).name.removeprefix("mjEQ_").lower()
    of_kind = {"joint": _OBJ.mjOBJ_JOINT, "tendon": _OBJ.mjOBJ_TENDON}
    parts = of_kind.get(kind, _OBJ(model.eq_objtype[tie]))
    ends = [end for end in (model.eq_obj1id[tie], model.eq_obj2id[tie]) if end >= 0]
    name = object_name(model, _OBJ.mjOBJ_EQUALITY, tie)
    return f"{name} ({kind} of {listed(object_names(model, parts, ends))})"


def _refuse_options(option: mujoco.MjOption) -> None:
    """Refuse motors or gravity switched off, and a fluid."""
    for name, bit in _DISABLED.items():
        if option.disableflags & bit:
            raise RobotError(
                f'The file switches {name} off: <flag {name}="disable"/>. Expected it to be on.'
            )
    off = int(option.disableactuator)
    if off:
        groups = [str(group) for group in range(off.bit_length()) if off >> group & 1]
        raise RobotError(
            f"The file switches actuators off: actuatorgroupdisable of the groups {listed(groups)}."
            " Expected motors that work."
        )
    for name in ("density", "viscosity", "wind"):
        value = getattr(option, name)
        if np.any(value):
            raise RobotError(
                f"A fluid about the robot is not supported: {name} {value} of <option>. Expected 0."
            )


def _refuse_extremes(model: mujoco.MjModel) -> None:
    """Refuse numbers beyond all that joints of a robot of this weight and size can have.

    They are told by what the weight does at the robot's size: a torque, and a time to fall.
    """
    size, gravity = max(model.stat.extent, 1e-9), float(np.linalg.norm(model.opt.gravity)) or 1.0
    torque, time = model.body_subtreemass[0] * gravity * size, float(np.sqrt(size / gravity))
    places = np.concatenate([model.body_pos.ravel(), model.jnt_pos.ravel(), model.qpos0])
    for name, values, most in (
        ("position", places, _MOST),
        ("stiffness", model.jnt_stiffness, _MOST * torque),
        ("damping", model.dof_damping, _MOST * torque * time),
        ("armature", model.dof_armature, _MOST * torque * time**2),
        ("frictionloss", model.dof_frictionloss, _MOST * torque),
    ):
        least = 0.0 if name in ("armature", "frictionloss") else -most
        wild = values[~((values >= least) & (values <= most))]
        if wild.size:
            raise RobotError(
                f"The robot has {name} {wild.flat[0]:.3g}, which no simulation can carry. "
                f"Expected at least {least:.3g} and at most {most:.3g}."
            )


def refuse_diverging(home: MeasuredModel, label: str) -> None:
    """Refuse what no simulation can carry: a few steps from home, without torques, tell."""
    model, data = home.model, mujoco.MjData(home.model)
    _refuse_extremes(model)  # once more, with what was not in the file
    data.qpos[:] = home.qpos
    with warnings_heard() as heard:
        for _ in range(_STEPS):
            mujoco.mj_step(model, data)
    if any(data.warning[int(kind)].number for kind in _BAD) or np.abs(home.qpos).max() > _MOST:
        why = f" ({heard[0]})" if heard else ""
        raise RobotError(
            f"{label} cannot be simulated: it diverges within {_STEPS} steps from home{why}. "
            "Expected masses, armature, damping and angles of a robot."
        )
