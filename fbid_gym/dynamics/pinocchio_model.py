"""A Pinocchio model of a robot, read from the compiled MuJoCo model.

Pinocchio's own MJCF parser is not used: it silently drops subtrees (`<frame>`, `<replicate>`,
`<include>`, a static body before the robot) and settings of the compiler (`settotalmass`,
`boundmass`, ...). The compiled model holds the numbers that are simulated.
"""

import mujoco
import numpy as np
import pinocchio as pin

from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.errors import RobotError

_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
_FREE, _BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
_ON_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))


def pinocchio_model(model: mujoco.MjModel) -> pin.Model:
    """Build the Pinocchio model of a floating-base robot.

    Joint coordinates are displacements from `model.qpos0`, the base's are those of Pinocchio's
    free-flyer; `fbid_gym.dynamics.frames` converts. Dofs keep MuJoCo's order. A body with several
    joints becomes a chain of massless ones; a body without joints is welded to its parent; what is
    fixed in the world carries no inertia. Frame number b is MuJoCo's body b (frame 0, the
    universe, is the world).

    The armature of hinges and slides, their actuators' included, is in `armature`. That of the
    free joint is not: MuJoCo holds it in its own coordinates, `dof_armature[:6]`.

    Args:
        model: compiled, with one free joint that comes first.

    Returns:
        The model, with MuJoCo's gravity, inertias and armature.

    Raises:
        RobotError: the model has no free joint or not first, has ball joints, or holds what its
            mass matrix alone cannot tell or Pinocchio's cannot hold: equality constraints, and
            armature on tendons or on actuators that drive anything but a hinge or slide.
    """
    _require_supported(model)
    result = pin.Model()
    result.name = "robot"
    gravity_off = model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    result.gravity = pin.Motion(
        np.zeros(3) if gravity_off else model.opt.gravity.copy(), np.zeros(3)
    )

    # Per body: the joint that carries it, and where the body's frame lies in that joint's frame.
    joint_of, place_of = [0], [pin.SE3.Identity()]
    for body in range(1, model.nbody):
        parent = model.body_parentid[body]
        rotation = quaternion_to_matrix(model.body_quat[body])
        joint, place = joint_of[parent], place_of[parent] * pin.SE3(rotation, model.body_pos[body])
        for index in range(model.body_jntnum[body]):
            source = model.body_jntadr[body] + index
            if model.jnt_type[source] == _FREE:
                # The configuration is the pose itself, whatever pose the file starts from.
                place = anchor = pin.SE3.Identity()
            else:
                anchor = pin.SE3(np.eye(3), model.jnt_pos[source])
            name = model.joint(source).name or f"joint {source}"
            # A joint turns about its anchor; what follows it is again placed in the body's frame.
            joint = result.addJoint(joint, _joint_model(model, source), place * anchor, name)
            place = anchor.inverse()
        joint_of.append(joint)
        place_of.append(place)
        if joint > 0:
            result.appendBodyToJoint(joint, _inertia(model, body), place)
        name = model.body(body).name or f"body {body}"
        if result.addFrame(pin.Frame(name, joint, 0, place, pin.FrameType.BODY)) != body:
            raise RobotError(f"Body {body} is unnamed, and another body is called {name!r}.")

    armature = model.dof_armature.copy()
    armature[:6] = 0.0
    for actuator in np.flatnonzero(model.actuator_armature):
        dof = model.jnt_dofadr[model.actuator_trnid[actuator, 0]]
        gear = model.actuator_gear[actuator, 0]
        armature[dof] += model.actuator_armature[actuator] * gear**2
    result.armature = armature
    return result


def _inertia(model: mujoco.MjModel, body: int) -> pin.Inertia:
    """Inertia of a body in its frame; MuJoCo stores the principal axes and moments at the CoM."""
    axes = quaternion_to_matrix(model.body_iquat[body])
    tensor = axes @ np.diag(model.body_inertia[body]) @ axes.T
    return pin.Inertia(float(model.body_mass[body]), model.body_ipos[body].copy(), tensor)


def _joint_model(model: mujoco.MjModel, joint: int) -> pin.JointModel:
    """Pinocchio's joint for MuJoCo's joint number `joint`."""
    kind, axis = model.jnt_type[joint], model.jnt_axis[joint].copy()
    if kind == _FREE:
        return pin.JointModelFreeFlyer()
    return (
        pin.JointModelPrismaticUnaligned(axis)
        if kind == _SLIDE
        else pin.JointModelRevoluteUnaligned(axis)
    )


def _require_supported(model: mujoco.MjModel) -> None:
    """Raise RobotError for what `pinocchio_model` would otherwise get silently wrong."""
    free = np.flatnonzero(model.jnt_type == _FREE)
    if len(free) != 1 or free[0] != 0:
        raise RobotError(
            f"The model has free joints at positions {free.tolist()} of its {model.njnt} joints. "
            "Expected exactly one, before all other joints."
        )
    ball = np.flatnonzero(model.jnt_type == _BALL)
    if len(ball):
        raise RobotError(
            f"Joint {model.joint(ball[0]).name!r} is a ball joint. "
            "Expected hinge and slide joints; write it as three hinges."
        )
    tied = np.count_nonzero(model.eq_active0)
    if tied:
        raise RobotError(
            f"The model has {tied} equality constraints, which M and h do not contain. "
            "Expected a tree of bodies without them."
        )
    tendon = np.flatnonzero(model.tendon_armature)
    if len(tendon):
        raise RobotError(
            f"Tendon {model.tendon(tendon[0]).name!r} has armature, which couples joints. "
            "Expected armature on joints and their actuators only."
        )
    for actuator in np.flatnonzero(model.actuator_armature):
        on_joint = int(model.actuator_trntype[actuator]) in _ON_JOINT
        if not on_joint or model.actuator_trnid[actuator, 0] == free[0]:
            raise RobotError(
                f"Actuator {model.actuator(actuator).name!r} has armature and does not drive a "
                "hinge or slide. Expected armature on joints and their actuators only."
            )
