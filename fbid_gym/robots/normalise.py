"""Strangers' files set right where it is plain what is meant, with a note of each change.

This is the first of two phases: a spec is changed, then the robot is measured, see `MeasuredModel`.
What a robot can do without is left out, what hinders MuJoCo is mended; what no law knows of is
refused by `unmodelled`.
"""

from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.contact_sensors import remove_contact_sensors
from fbid_gym.robots.locks import leave_out_idle, lock_equal_limits, lock_tied
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.meshes import mend_meshes
from fbid_gym.robots.mjcf import compile_spec, listed
from fbid_gym.robots.source import Source

_JOINT = mujoco.mjtJoint
_DISABLE = mujoco.mjtDisableBit

# Of the robot's mass, and of that times the square of its longest link: a dummy link's.
_DUMMY = 1e-6
_LEAST_ITERATIONS = 10
_ENOUGH = {"iterations": ("Solver iterations", 100), "ls_iterations": ("Line searches", 50)}
_SWITCHES = {
    "spring": (_DISABLE.mjDSBL_SPRING, "stiffness"),
    "damper": (_DISABLE.mjDSBL_DAMPER, "damping"),
    "frictionloss": (_DISABLE.mjDSBL_FRICTIONLOSS, "frictionloss"),
}
_OF_JOINTS = ("armature", "damping", "frictionloss", "stiffness")


class Normal(NamedTuple):
    """A description set right: what `Robot.save` writes."""

    spec: mujoco.MjSpec
    model: mujoco.MjModel  # the same, compiled
    notes: list[str]  # of what was changed
    bare: list[str]  # names of bodies that lost a mesh which they collide with


def normalise(source: Source, base: str | None) -> Normal:
    """Read a description, and set its parts right; a URDF's root, or the body that shall, floats.

    Raises RobotError where it cannot be read or compiled, or has no body of that name.
    """
    spec, notes = source.read()
    remove_contact_sensors(spec)
    spec.compiler.fusestatic = False  # or feet could not be named
    bare = list[str]()
    if not isinstance(source.content, bytes):
        changes, bare = mend_meshes(spec, source.folder, source.is_urdf)
        notes += changes
    if source.is_urdf:
        notes += _weigh_nothing(spec)
        if base is None:
            notes += _free_root(spec)
            top = list(spec.worldbody.bodies)  # one link, if it does not move yet
            base = top[0].name if len(top) == 1 and not list(top[0].joints) else None
    if base is not None and not any(map(_is_free, spec.joints)):
        notes += _float(spec, base, source.label)
    notes += _switch_off(spec)
    notes += _touch_all_ground(spec)
    mends = [_mend_shells, _mend_inertias]
    while True:
        try:
            model = compile_spec(spec, source.label)
            break
        except RobotError as error:
            if not mends:
                raise
            notes += mends.pop(0)(spec, str(error))
    locks = partial(lock_equal_limits, urdf=source.text if source.is_urdf else b"")
    for change in (locks, lock_tied, leave_out_idle):
        changed = change(spec, model)
        if changed:
            model, notes = compile_spec(spec, source.label), notes + changed
    notes += _clip_keyframes(spec, model)
    return Normal(spec, model, notes, bare)


def _weigh_nothing(spec: mujoco.MjSpec) -> list[str]:
    """Take the mass that MuJoCo makes of the shapes of links that a URDF gives none; notes."""
    bare = [body for body in spec.bodies if not body.explicitinertial and list(body.geoms)]
    for geom in (geom for body in bare for geom in body.geoms):
        geom.mass = geom.density = 0.0
    names = listed([body.name for body in bare])
    return [f"Links without an inertia weigh nothing: {names}."] if bare else []


def simulate_well(spec: mujoco.MjSpec) -> list[str]:
    """Free the base of what no floating body has, and let the solver converge; returns notes.

    A floating body's momentum would not be its own. Defaults for joints reach the free joint as
    well, if it is written as a joint.
    """
    option, notes = spec.option, []
    free = next(joint for joint in spec.joints if _is_free(joint))
    held = {name: float(np.max(getattr(free, name))) for name in _OF_JOINTS}
    losses = ", ".join(f"{name} {value:g}" for name, value in held.items() if value)
    if losses:
        notes.append(f"Removed from the free joint, where it would falsify the momentum: {losses}.")
        for name in _OF_JOINTS:
            setattr(free, name, np.zeros_like(getattr(free, name)))
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for name, (what, enough) in _ENOUGH.items():
        if getattr(option, name) < _LEAST_ITERATIONS:
            notes.append(f"{what} raised from {getattr(option, name)} to {enough}.")
            setattr(option, name, enough)
    return notes


def exclude_overlaps(
    spec: mujoco.MjSpec, home: MeasuredModel, bodies: Mapping[int, mujoco.MjsBody]
) -> list[str]:
    """Let bodies of the robot that lie in one another at home touch no more; returns notes."""
    model, deepest = home.model, dict[tuple[int, int], float]()
    for contact in home.forward.contact:
        first, second = sorted(int(body) for body in model.geom_bodyid[contact.geom])
        if contact.dist < 0.0 and model.body_weldid[first] and model.body_weldid[second]:
            pair = first, second
            deepest[pair] = min(deepest.get(pair, 0.0), float(contact.dist))
    told = []
    for pair, depth in deepest.items():
        for body in pair:
            bodies[body].name = bodies[body].name or f"fbid_body_{body}"
        one, other = (str(bodies[body].name) for body in pair)
        spec.add_exclude(bodyname1=one, bodyname2=other)
        told.append(f"{one} and {other} ({-1e3 * depth:.2g} mm)")
    return [f"Lie in one another at home, and touch no more: {listed(told)}."] if told else []


def _is_free(joint: mujoco.MjsJoint) -> bool:
    return bool(joint.type == _JOINT.mjJNT_FREE)


def _free_root(spec: mujoco.MjSpec) -> list[str]:
    """Take the joints of a URDF's massless root links, `map`, `odom`, …, and of what they carry.

    By these somebody moves the robot about; here it floats.
    """
    taken, top = list[mujoco.MjsJoint](), list(spec.worldbody.bodies)
    body = top[0] if len(top) == 1 else None
    while body is not None:
        taken += [joint for joint in body.joints if body is not top[0] or not _is_free(joint)]
        inside = list(body.bodies)
        hollow = body.mass == 0.0 and not list(body.geoms) and len(inside) == 1
        body = inside[0] if hollow else None
    if not taken or top[0].mass > 0.0 or list(top[0].geoms):
        return []
    names = [joint.name for joint in taken]
    for joint in taken:
        spec.delete(joint)
    return [f"Joints that move the base about left out: {listed(names)}."]


def _float(spec: mujoco.MjSpec, base: str, label: str) -> list[str]:
    """Give a free joint to a top-level body of a file that has none.

    Files converted from URDF often fix the robot to the world. Their keyframes begin with the
    first joint's angle: the body's place goes before it, or MuJoCo would take angles for places.
    """
    top_level = {body.name: body for body in spec.worldbody.bodies}
    if base not in top_level:
        raise RobotError(f"No top-level body {base!r}. Valid choices: {listed(top_level)}.")
    body = top_level[base]
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


def _switch_off(spec: mujoco.MjSpec) -> list[str]:
    """Take what a `<flag>` switches off, or overrides: laws would count on what the file says."""
    off, option = list[str](), spec.option
    for name, (bit, field) in _SWITCHES.items():
        if option.disableflags & int(bit):
            option.disableflags &= ~int(bit)
            off.append(name)
            for joint in spec.joints:
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


def _touch_all_ground(spec: mujoco.MjSpec) -> list[str]:
    """Let what touches the ground by a `<pair>` touch any ground, by the pair's numbers.

    Terrain is in no pair. The ground may be in another file, which includes that of the robot.
    """
    moving = {geom.name: _moves(geom.parent) for geom in spec.geoms}
    elsewhere = all(_moves(geom.parent) for geom in spec.geoms)
    priority, touch = 1 + max([geom.priority for geom in spec.geoms], default=0), list[str]()
    for pair in list(spec.pairs):
        own, ground = pair.geomname1, pair.geomname2
        if not moving.get(own):
            own, ground = ground, own
        if not moving.get(own) or moving.get(ground, not elsewhere):
            continue
        foot, floor = spec.geom(own), spec.geom(ground)
        for geom, bits in ((foot, "conaffinity"), (floor, "contype")):
            if geom is not None:
                setattr(geom, bits, getattr(geom, bits) | 1)
        foot.condim, foot.friction = pair.condim, pair.friction[[0, 2, 3]]
        foot.solref, foot.solimp, foot.priority = pair.solref, pair.solimp, priority
        spec.delete(pair)
        touch.append(own)
    return [f"Touch any ground, not only that of a <pair>: {listed(touch)}."] if touch else []


def _moves(body: mujoco.MjsBody | None) -> bool:
    """Whether a body is not fixed to the world."""
    return body is not None and (len(list(body.joints)) > 0 or _moves(body.parent))


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


def _clip_keyframes(spec: mujoco.MjSpec, model: mujoco.MjModel) -> list[str]:
    """Bring the joints of keyframes into their ranges, where little is missing, of both."""
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
            key.qpos = model.key_qpos[key.id] = qpos
            names.append(key.name or "(unnamed)")
    return [f"Keyframes clipped to the joints' ranges: {listed(names)}."] if names else []
