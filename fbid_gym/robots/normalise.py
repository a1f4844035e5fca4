"""Strangers' files set right where it is plain what is meant, with a note of each change.

This is the first of two phases: a spec is changed, then the robot is measured, see `MeasuredModel`.
What a robot can do without is left out, what hinders MuJoCo is mended; what no law knows of is
refused by `unmodelled`.
"""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots import mjcf
from fbid_gym.robots.contact_sensors import remove_contact_sensors
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.meshes import mend_meshes
from fbid_gym.robots.mjcf import listed
from fbid_gym.robots.source import Source
from fbid_gym.robots.touching import bodies_of_feet

_JOINT = mujoco.mjtJoint
_DISABLE = mujoco.mjtDisableBit

# Of the robot's mass, and of that times the square of its longest link: a dummy link's.
_DUMMY = 1e-6

_SWITCHES = {
    "spring": (_DISABLE.mjDSBL_SPRING, ("stiffness",)),
    "damper": (_DISABLE.mjDSBL_DAMPER, ("damping",)),
    "frictionloss": (_DISABLE.mjDSBL_FRICTIONLOSS, ("frictionloss",)),
}


def read_plain(source: Source, base: str | None) -> tuple[mujoco.MjSpec, list[str], list[str]]:
    """Read a file, and set its parts right; a URDF's root, or the body that shall, floats.

    Returns:
        The spec, notes of what was changed, and names of bodies that lost a mesh they collide with.

    Raises:
        RobotError: the file cannot be read, or has no body of that name.
    """
    spec, notes = source.read()
    remove_contact_sensors(spec)
    spec.compiler.fusestatic = False  # or feet could not be named
    folder = source.content.parent if isinstance(source.content, Path) else None
    bare = list[str]()
    if not isinstance(source.content, bytes):
        changes, bare = mend_meshes(spec, folder, source.is_urdf)
        notes += changes
    if source.is_urdf:
        told = _limits(source.text)
        locked = {joint: told[joint.name] for joint in spec.joints if joint.name in told}
        notes += _lock(spec, locked, "whose limits are equal")
    notes += _free_root(spec) if source.is_urdf and base is None else []
    if base is None and source.is_urdf and not _floats(spec):
        base = _root_link(spec)
    if base is not None and not _floats(spec):
        notes += mjcf.float_base(spec, base, source.label)
    notes += _switch_off(spec)
    return spec, notes, bare


def compile_plain(spec: mujoco.MjSpec, label: str) -> tuple[mujoco.MjModel, list[str]]:
    """Compile a spec for the first time, and mend what MuJoCo cannot: inertias, idle joints, poses.

    Returns:
        The model, and notes of what was changed.

    Raises:
        RobotError: MuJoCo cannot compile it.
    """
    notes: list[str] = []
    for mend in (_mend_shells, _mend_inertias):
        try:
            with mjcf.warnings_heard():
                spec.compile()
            break
        except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
            notes += mend(spec, str(error))
    model = mjcf.compile_spec(spec, label)
    for change in (_lock_tied, _weld_idle, _clip_keyframes):
        changed = change(spec, model)
        if changed:
            model, notes = mjcf.compile_spec(spec, label), notes + changed
    return model, notes


def exclude_overlaps(
    spec: mujoco.MjSpec, home: MeasuredModel, bodies: Mapping[int, mujoco.MjsBody]
) -> list[str]:
    """Let bodies of the robot that lie in one another at home touch no more; returns notes."""
    model, data = home.model, mujoco.MjData(home.model)
    data.qpos[:] = home.qpos
    mujoco.mj_fwdPosition(model, data)
    deepest = dict[tuple[int, int], float]()
    for contact in data.contact:
        first, second = sorted(int(body) for body in model.geom_bodyid[contact.geom])
        if contact.dist < 0.0 and model.body_weldid[first] and model.body_weldid[second]:
            pair = first, second
            deepest[pair] = min(deepest.get(pair, 0.0), float(contact.dist))
    told = []
    for pair, depth in deepest.items():
        one, other = (_named(bodies[body]) for body in pair)
        spec.add_exclude(bodyname1=one, bodyname2=other)
        told.append(f"{one} and {other} ({-1e3 * depth:.2g} mm)")
    return [f"Lie in one another at home, and touch no more: {listed(told)}."] if told else []


def _named(body: mujoco.MjsBody) -> str:
    body.name = body.name or f"fbid_body_{body.id}"
    return str(body.name)


def _floats(spec: mujoco.MjSpec) -> bool:
    return any(joint.type == _JOINT.mjJNT_FREE for joint in spec.joints)


def _root_link(spec: mujoco.MjSpec) -> str | None:
    """Name of the one top-level body, if it does not move yet."""
    top = list(spec.worldbody.bodies)
    return top[0].name if len(top) == 1 and not list(top[0].joints) else None


def _free_root(spec: mujoco.MjSpec) -> list[str]:
    """Take the joints of a URDF's massless root links, `map`, `odom`, …, and of what they carry.

    By these somebody moves the robot about; here it floats.
    """
    taken, top = list[str](), list(spec.worldbody.bodies)
    body = top[0] if len(top) == 1 else None
    while body is not None:
        taken += [joint.name for joint in body.joints if body is not top[0] or not _is_free(joint)]
        inside = list(body.bodies)
        hollow = body.mass == 0.0 and not list(body.geoms) and len(inside) == 1
        body = inside[0] if hollow else None
    if not taken or top[0].mass > 0.0 or list(top[0].geoms):
        return []
    for joint in [joint for joint in spec.joints if joint.name in taken]:
        spec.delete(joint)
    return [f"Joints that move the base about left out: {listed(taken)}."]


def _is_free(joint: mujoco.MjsJoint) -> bool:
    return bool(joint.type == _JOINT.mjJNT_FREE)


def _limits(urdf: bytes) -> dict[str, float]:
    """Joints whose lower and upper limit a URDF gives, and gives as one: MuJoCo ignores these."""
    found = {}
    with suppress(ElementTree.ParseError, ValueError):  # MuJoCo is less strict
        for joint in ElementTree.fromstring(urdf).iter("joint"):
            limit = joint.find("limit")
            if limit is not None and joint.get("type") in ("revolute", "prismatic"):
                low, high = limit.get("lower"), limit.get("upper")
                if low and high and float(low) == float(high):
                    found[joint.get("name", "")] = float(low)
    return found


def _lock_tied(spec: mujoco.MjSpec, model: mujoco.MjModel) -> list[str]:
    """Lock joints that an `<equality>` ties to a constant, or to each other where no foot hangs.

    Fingers that follow one another do not walk; legs whose joints do are refused, see `unmodelled`.
    """
    joints, legs = {joint.name: joint for joint in spec.joints}, _joints_of_legs(model)
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


def _joints_of_legs(model: mujoco.MjModel) -> set[str]:
    """Names of the joints that feet hang from, as far as they are found; else of all joints."""
    drawn = MeasuredModel(model, model.qpos0)
    every = set(range(model.njnt))
    with suppress(RobotError):
        every = {joint for foot in bodies_of_feet(drawn) for joint in drawn.joints_above(foot)}
    return {model.joint(int(joint)).name for joint in every}


def _lock(
    spec: mujoco.MjSpec,
    locked: Mapping[mujoco.MjsJoint, float],
    why: str,
    model: mujoco.MjModel | None = None,
) -> list[str]:
    """Take joints, and leave their bodies where the joints' values (rad, m) have them."""
    if not locked:
        return []
    names = [joint.name for joint in locked]
    for joint, value in locked.items():
        _move(joint.parent, joint, value - joint.ref)
    _forget(spec, list(locked), model)
    return [f"Joints locked, {why}: {listed(names)}."]


def _forget(
    spec: mujoco.MjSpec, joints: list[mujoco.MjsJoint], model: mujoco.MjModel | None
) -> None:
    """Take joints, what acts on them, and their places in keyframes of a spec that is `model`."""
    names = {joint.name for joint in joints}
    if model is not None:
        gone = [j for j in range(model.njnt) if model.joint(j).name in names]
        places = [model.jnt_qposadr[j] + np.arange(_width(model, j)) for j in gone]
        kept = np.delete(np.arange(model.nq), np.concatenate(places))
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


def _switch_off(spec: mujoco.MjSpec) -> list[str]:
    """Take what a `<flag>` switches off, or overrides: laws would count on what the file says."""
    off, option = list[str](), spec.option
    for name, (bit, fields) in _SWITCHES.items():
        if option.disableflags & int(bit):
            option.disableflags &= ~int(bit)
            off.append(name)
            for joint in spec.joints:
                for field in fields:
                    setattr(joint, field, np.zeros_like(getattr(joint, field)))
    notes = [f"Taken, as <flag> switches them off: {listed(off)}."] if off else []
    override = int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)
    if option.enableflags & override:
        option.enableflags &= ~override
        for geom in spec.geoms:
            geom.friction = [option.o_friction[0], *option.o_friction[2:4]]
            geom.solref, geom.solimp = option.o_solref, option.o_solimp
            geom.margin = 0.5 * option.o_margin
        notes.append("Contacts as <flag override> has them, on every geom.")
    return notes


def _mend_shells(spec: mujoco.MjSpec, error: str) -> list[str]:
    """Take meshes that enclose nothing for shells."""
    if "mesh volume is too small" not in error:
        return []
    for mesh in spec.meshes:
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    return ["Meshes weigh by their surface: one encloses no volume."]


def _mend_inertias(spec: mujoco.MjSpec, error: str) -> list[str]:
    """Give links without mass a millionth of the robot's; balance impossible inertias."""
    if "inertia" not in error and "mass" not in error:
        return []
    total = sum(float(body.mass) for body in spec.bodies) or 1.0
    longest = max([float(np.linalg.norm(body.pos)) for body in spec.bodies], default=1.0) or 1.0
    least = _DUMMY * total * longest**2
    compiler, changed = spec.compiler, list[str]()
    compiler.balanceinertia = True
    compiler.boundmass = max(compiler.boundmass, _DUMMY * total)
    compiler.boundinertia = max(compiler.boundinertia, least)
    for body in spec.bodies:
        whole = np.asarray(body.fullinertia)
        if not np.isfinite(whole).all():
            continue
        (xx, yy, zz), (xy, xz, yz) = whole[:3], whole[3:]
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if moments[0] <= 0.0:
            mend = least - min(float(moments[0]), 0.0)
            body.fullinertia = whole + mend * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
            changed.append(body.name)
    told = f", {listed(changed)} among them" if changed else ""
    return [
        f"Masses and inertias that no body has were balanced, or raised to a millionth of the "
        f"robot's{told}."
    ]


def _weld_idle(spec: mujoco.MjSpec, model: mujoco.MjModel) -> list[str]:
    """Weld to the world what hangs there from joints that nothing drives."""
    free = np.flatnonzero(model.jnt_type == _JOINT.mjJNT_FREE)
    if len(free) != 1:
        return []
    root = int(model.jnt_bodyid[free[0]])
    outside = np.flatnonzero(model.body_rootid[model.jnt_bodyid] != root).tolist()
    if not outside or np.isin(outside, model.actuator_trnid[:, 0]).any():
        return []
    joints = {joint.id: joint for joint in spec.joints}
    names = mjcf.object_names(model, mujoco.mjtObj.mjOBJ_JOINT, outside)
    _forget(spec, [joints[j] for j in outside], model)
    return [f"Idle joints beside the robot left out: {listed(names)}."]


def _width(model: mujoco.MjModel, joint: int) -> int:
    return 4 if model.jnt_type[joint] == _JOINT.mjJNT_BALL else 1


def _clip_keyframes(spec: mujoco.MjSpec, model: mujoco.MjModel) -> list[str]:
    """Bring the joints of keyframes into their ranges, where little is missing."""
    limited = np.flatnonzero(model.jnt_limited)
    place = model.jnt_qposadr[limited]
    low, high = model.jnt_range[limited].T
    near, names = 0.05 * (high - low), list[str]()
    for key in spec.keys:
        qpos = np.array(key.qpos)
        if len(qpos) != model.nq:
            continue
        inside = np.clip(qpos[place], low, high)
        off = np.abs(inside - qpos[place])
        if np.any((off > 1e-6) & (off <= near)) and np.all(off <= near):
            qpos[place] = inside
            key.qpos = qpos
            names.append(key.name or "(unnamed)")
    return [f"Keyframes clipped to the joints' ranges: {listed(names)}."] if names else []
