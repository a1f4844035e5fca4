"""Reading an MJCF as a floating-base robot: one free-floating tree of hinges and slides."""

from collections.abc import Iterable

import mujoco
import numpy as np

from fbid_gym.errors import RobotError

_JOINT = mujoco.mjtJoint
_OBJ = mujoco.mjtObj


def compile_spec(spec: mujoco.MjSpec, label: str) -> mujoco.MjModel:
    """Compile a spec, which messages call `label`.

    Raises:
        RobotError: MuJoCo cannot compile it.
    """
    try:
        return spec.compile()
    except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
        raise RobotError(f"{label} does not compile: {error}") from error


def object_name(model: mujoco.MjModel, kind: int, index: int) -> str:
    """Name of a model element, or its number where the file gives none."""
    return mujoco.mj_id2name(model, kind, index) or f"#{index}"


def object_names(model: mujoco.MjModel, kind: int, indices: Iterable[int]) -> list[str]:
    """Names of model elements, see `object_name`."""
    return [object_name(model, kind, int(index)) for index in indices]


def listed(names: Iterable[str]) -> str:
    """Names as they appear in messages."""
    return ", ".join(names) or "(none)"


def float_base(spec: mujoco.MjSpec, base: str, label: str) -> list[str]:
    """Give a free joint to a top-level body of a file that has none.

    Files converted from URDF often fix the robot to the world. Their keyframes begin with the
    first joint's angle: the body's place goes before it, or MuJoCo would take angles for places.

    Args:
        spec: the spec to change.
        base: name of the body.
        label: what messages call the spec.

    Returns:
        Notes of what was changed.

    Raises:
        RobotError: no such top-level body, the body already has joints, or there are keyframes and
            the spec does not compile.
    """
    top_level = [body.name for body in spec.worldbody.bodies]
    body = next((b for b in spec.worldbody.bodies if b.name == base), None)
    if body is None:
        raise RobotError(f"No top-level body {base!r}. Valid choices: {listed(top_level)}.")
    if len(body.joints) > 0:
        names = [joint.name for joint in body.joints]
        raise RobotError(
            f"Body {base!r} cannot be made to float: it already has the joints {listed(names)}."
        )
    notes = [f"Body {base!r} was made to float."]
    posed = [key for key in spec.keys if len(key.qpos) or len(key.qvel)]
    if posed:
        fixed = compile_spec(spec.copy(), label).body(base)
        place = [*fixed.pos, *fixed.quat]
        for key in posed:
            key.qpos = [*place, *key.qpos] if len(key.qpos) else []
            key.qvel = [*np.zeros(6), *key.qvel] if len(key.qvel) else []
        names = [key.name or "(unnamed)" for key in posed]
        notes.append(f"Its place was put before the joints of the keyframes {listed(names)}.")
    body.add_freejoint()
    return notes


def weight_of(model: mujoco.MjModel) -> float:
    """Return the weight in N of the robot, the tree of the first joint."""
    return float(model.body_subtreemass[model.jnt_bodyid[0]]) * gravity_of(model)


def gravity_of(model: mujoco.MjModel) -> float:
    """Return the size of gravity in m/s²."""
    return float(np.linalg.norm(model.opt.gravity))


def free_joints(model: mujoco.MjModel) -> list[int]:
    """Ids of the free joints."""
    return [int(j) for j in np.flatnonzero(model.jnt_type == _JOINT.mjJNT_FREE)]


def moving_joints(model: mujoco.MjModel) -> list[int]:
    """Ids of the hinges and slides, in dof order."""
    return [int(j) for j in np.flatnonzero(model.jnt_type != _JOINT.mjJNT_FREE)]


def name_joints(spec: mujoco.MjSpec, model: mujoco.MjModel) -> tuple[str, ...]:
    """Give joints without a name one that no other has; returns those that move, in dof order."""
    joints = {joint.id: joint for joint in spec.joints}
    taken = {joint.name for joint in spec.joints}
    for j, joint in joints.items():
        if not joint.name:
            name = f"joint_{j}"
            while name in taken:
                name += "_"
            joint.name = name
            taken.add(name)
    return tuple(joints[j].name for j in moving_joints(model))


def hinges_above(model: mujoco.MjModel, body: int) -> list[int]:
    """Ids of the hinges between the base and a body, from the base on."""
    chain: list[int] = []
    while body > 0 and model.jnt_bodyid[0] != body:
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        chain[:0] = range(first, first + count)
        body = int(model.body_parentid[body])
    return [j for j in chain if model.jnt_type[j] == _JOINT.mjJNT_HINGE]


def posed(model: mujoco.MjModel, qpos: np.ndarray) -> mujoco.MjData:
    """Return the kinematics of a pose (nq,), centres of mass among them."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def can_touch(model: mujoco.MjModel) -> np.ndarray:
    """(ngeom,) bool, geoms that can touch the ground.

    A `<pair>` does not count: no robot has one with the ground, see `unmodelled`.
    """
    return (model.geom_contype != 0) | (model.geom_conaffinity != 0)


def static_geoms(model: mujoco.MjModel) -> np.ndarray:
    """(ngeom,) bool, geoms of the static world, or of what only a mocap moves, that can touch."""
    root = model.body_weldid[model.geom_bodyid]
    return ((root == 0) | (model.body_mocapid[root] >= 0)) & can_touch(model)


def check_tree(model: mujoco.MjModel) -> int:
    """Check that the model is one floating tree of hinges and slides.

    Returns:
        Id of the floating body.

    Raises:
        RobotError: no free joint, several, one below another body, ball joints, joints outside the
            robot, or closed loops.
    """
    free = free_joints(model)
    if not free:
        inside = np.flatnonzero(model.body_parentid[1:] == 0) + 1
        top_level = object_names(model, _OBJ.mjOBJ_BODY, inside)
        raise RobotError(
            "The robot has no free joint, so its base does not float. Add one to the base body, or "
            f"pass base= one of the top-level bodies: {listed(top_level)}."
        )
    bases = object_names(model, _OBJ.mjOBJ_BODY, model.jnt_bodyid[free])
    if len(free) > 1:
        raise RobotError(
            f"The file has {len(free)} free joints, on bodies {listed(bases)}. "
            "Expected exactly one."
        )
    base = int(model.jnt_bodyid[free[0]])
    ball = np.flatnonzero(model.jnt_type == _JOINT.mjJNT_BALL)
    if ball.size:
        names = object_names(model, _OBJ.mjOBJ_JOINT, ball)
        raise RobotError(
            f"Ball joints are not supported: {listed(names)}. Expected hinges and slides only "
            "(three hinges on one body make a ball)."
        )
    outside = np.flatnonzero(model.body_rootid[model.jnt_bodyid] != base)
    if outside.size:
        names = object_names(model, _OBJ.mjOBJ_JOINT, outside)
        raise RobotError(
            f"Joints {listed(names)} do not belong to the floating tree of {bases[0]!r}. "
            "Expected one robot and a static world."
        )
    tied = np.flatnonzero(model.eq_active0)
    if tied.size:
        names = object_names(model, _OBJ.mjOBJ_EQUALITY, tied)
        raise RobotError(
            f"Equality constraints are not supported: {listed(names)}. "
            "Expected a tree without closed loops."
        )
    return base
