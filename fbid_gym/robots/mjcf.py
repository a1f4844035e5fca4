"""Reading an MJCF as a floating-base robot: what the file must have, and what is added to it.

A robot here is one free-floating tree of hinges and slides in which every joint is driven by one
torque motor, so that the selection matrix of [M10] eq. (2) is S = [0 I]. Each function below checks
one part of that and says in one `RobotError` what is missing.
"""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from fbid_gym.errors import RobotError

_JOINT = mujoco.mjtJoint
_GEOM = mujoco.mjtGeom
_OBJ = mujoco.mjtObj


@dataclass(frozen=True)
class ContactPoint:
    """One contact point of a foot, as found in the compiled model.

    Attributes:
        name: name of the site or geom.
        kind: `mjOBJ_SITE` or `mjOBJ_GEOM`.
        body: id of the body that carries it.
        position: (3,) m, in the body's frame.
        radius: m. 0 for a site; the sphere's radius for a geom.
    """

    name: str
    kind: int
    body: int
    position: np.ndarray
    radius: float


def read_spec(path: str | Path) -> mujoco.MjSpec:
    """Parse an MJCF file.

    Raises:
        RobotError: the file does not exist or MuJoCo cannot parse it.
    """
    path = Path(path)
    if not path.is_file():
        raise RobotError(f"Robot file {str(path)!r} does not exist. Expected the path of an MJCF file.")
    try:
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise RobotError(f"Robot file {str(path)!r} is not a valid MJCF: {error}") from error


def compile_spec(spec: mujoco.MjSpec, path: str | Path) -> mujoco.MjModel:
    """Compile a spec.

    Raises:
        RobotError: MuJoCo cannot compile it.
    """
    try:
        return spec.compile()
    except ValueError as error:
        raise RobotError(f"Robot file {str(path)!r} does not compile: {error}") from error


def object_name(model: mujoco.MjModel, kind: int, index: int) -> str:
    """Name of a model element, or its number where the file gives none."""
    return mujoco.mj_id2name(model, kind, index) or f"#{index}"


def float_base(spec: mujoco.MjSpec, base: str) -> None:
    """Give a free joint to a top-level body of a file that has none.

    Files converted from URDF often fix the robot to the world.

    Raises:
        RobotError: no such top-level body, or the body already has joints.
    """
    top_level = [body.name for body in spec.worldbody.bodies]
    body = next((b for b in spec.worldbody.bodies if b.name == base), None)
    if body is None:
        raise RobotError(f"No top-level body {base!r}. Valid choices: {_listed(top_level)}.")
    if len(body.joints) > 0:
        names = [joint.name for joint in body.joints]
        raise RobotError(
            f"Body {base!r} cannot be made to float: it already has the joints {_listed(names)}."
        )
    body.add_freejoint()


def free_joints(model: mujoco.MjModel) -> list[int]:
    """Ids of the free joints."""
    return [int(j) for j in np.flatnonzero(model.jnt_type == _JOINT.mjJNT_FREE)]


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
        top_level = [
            object_name(model, _OBJ.mjOBJ_BODY, b)
            for b in range(1, model.nbody)
            if model.body_parentid[b] == 0
        ]
        raise RobotError(
            "The robot has no free joint, so its base does not float. Add one to the base body, or "
            f"pass base= one of the top-level bodies: {_listed(top_level)}."
        )
    bases = [object_name(model, _OBJ.mjOBJ_BODY, int(model.jnt_bodyid[j])) for j in free]
    if len(free) > 1:
        raise RobotError(
            f"The file has {len(free)} free joints, on bodies {_listed(bases)}. Expected exactly one."
        )
    base = int(model.jnt_bodyid[free[0]])
    ball = np.flatnonzero(model.jnt_type == _JOINT.mjJNT_BALL)
    if ball.size:
        names = [object_name(model, _OBJ.mjOBJ_JOINT, int(j)) for j in ball]
        raise RobotError(
            f"Ball joints are not supported: {_listed(names)}. Expected hinge and slide joints only "
            "(three hinges on one body make a ball)."
        )
    outside = [
        object_name(model, _OBJ.mjOBJ_JOINT, j)
        for j in range(model.njnt)
        if model.body_rootid[model.jnt_bodyid[j]] != base
    ]
    if outside:
        raise RobotError(
            f"Joints {_listed(outside)} do not belong to the floating tree of {bases[0]!r}. "
            "Expected one robot and a static world."
        )
    if model.neq:
        names = [object_name(model, _OBJ.mjOBJ_EQUALITY, i) for i in range(model.neq)]
        raise RobotError(
            f"Equality constraints {_listed(names)}: closed loops are not modelled. Expected a tree."
        )
    return base


def motor_of_each_joint(
    model: mujoco.MjModel,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the torque motor of every joint and its limit.

    The limit is the smallest magnitude among gear * ctrlrange, gear * forcerange and the joint's
    actuatorfrcrange. An asymmetric range counts by its smaller side: a controller that keeps to a
    symmetric limit then never saturates, at the price of the stronger side's excess.

    Returns:
        actuator (n,) ids; gear (n,), torque per unit of ctrl; torque_limit (n,) in N m (N for slides).
        Joints in dof order, without the base.

    Raises:
        RobotError: a joint without or with several actuators, an actuator that is not a plain torque
            motor, or a motor without a finite, two-sided limit.
    """
    driven: dict[int, list[int]] = {j: [] for j in range(model.njnt)}
    for a in range(model.nu):
        reason = _not_a_motor(model, a)
        if reason:
            raise RobotError(
                f"Actuator {object_name(model, _OBJ.mjOBJ_ACTUATOR, a)!r} {reason}. "
                "Expected plain torque motors (<motor joint=... ctrlrange=...>)."
            )
        driven[int(model.actuator_trnid[a, 0])].append(a)
    joints = [j for j in range(model.njnt) if model.jnt_type[j] != _JOINT.mjJNT_FREE]
    missing = [object_name(model, _OBJ.mjOBJ_JOINT, j) for j in joints if not driven[j]]
    if missing:
        raise RobotError(
            f"Joints without an actuator: {_listed(missing)}. Expected one motor per joint."
        )
    for j in joints:
        if len(driven[j]) > 1:
            names = [object_name(model, _OBJ.mjOBJ_ACTUATOR, a) for a in driven[j]]
            raise RobotError(
                f"Joint {object_name(model, _OBJ.mjOBJ_JOINT, j)!r} has {len(names)} actuators: "
                f"{_listed(names)}. Expected one motor per joint."
            )
    actuator = np.array([driven[j][0] for j in joints], dtype=int)
    gear = model.actuator_gear[actuator, 0] * model.actuator_gainprm[actuator, 0]
    limit = np.array(
        [_torque_limit(model, a, j) for a, j in zip(actuator, joints, strict=True)], dtype=float
    )
    return actuator, gear, limit


def find_point(model: mujoco.MjModel, name: str) -> ContactPoint:
    """Find a contact point by name: a site, or a sphere or capsule geom.

    A capsule counts by its end sphere farther from the body's origin: the tip of a leg. Where a site
    and a geom share the name, the site is meant.

    Raises:
        RobotError: no such site or geom, another geom type, or a point fixed to the world.
    """
    site = mujoco.mj_name2id(model, _OBJ.mjOBJ_SITE, name)
    geom = mujoco.mj_name2id(model, _OBJ.mjOBJ_GEOM, name)
    if site < 0 and geom < 0:
        raise RobotError(f"No site or geom {name!r}. Valid choices: {_listed(point_names(model))}.")
    if site >= 0:
        kind, body = _OBJ.mjOBJ_SITE, int(model.site_bodyid[site])
        position, radius = model.site_pos[site].copy(), 0.0
    else:
        kind, body = _OBJ.mjOBJ_GEOM, int(model.geom_bodyid[geom])
        position, radius = model.geom_pos[geom].copy(), float(model.geom_size[geom, 0])
        if model.geom_type[geom] == _GEOM.mjGEOM_CAPSULE:
            axis = np.empty(9)
            mujoco.mju_quat2Mat(axis, model.geom_quat[geom])
            half = model.geom_size[geom, 1] * axis.reshape(3, 3)[:, 2]
            position = max(position + half, position - half, key=lambda p: float(p @ p))
        elif model.geom_type[geom] != _GEOM.mjGEOM_SPHERE:
            shape = _GEOM(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
            raise RobotError(
                f"Geom {name!r} is a {shape}, which has no single contact point. Name sites at its "
                f"corners instead, or one of: {_listed(point_names(model))}."
            )
    if model.body_weldid[body] == 0:
        raise RobotError(
            f"Contact point {name!r} is fixed to the world. Valid choices: "
            f"{_listed(point_names(model))}."
        )
    return ContactPoint(name, int(kind), body, position, radius)


def point_names(model: mujoco.MjModel) -> list[str]:
    """Names that can serve as contact points: sites, and sphere and capsule geoms, of the robot."""
    names = [
        mujoco.mj_id2name(model, _OBJ.mjOBJ_SITE, i)
        for i in range(model.nsite)
        if model.body_weldid[model.site_bodyid[i]] != 0
    ]
    names += [
        mujoco.mj_id2name(model, _OBJ.mjOBJ_GEOM, i)
        for i in range(model.ngeom)
        if model.body_weldid[model.geom_bodyid[i]] != 0
        and int(model.geom_type[i]) in (_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_CAPSULE)
    ]
    return sorted({name for name in names if name})


def add_ground(spec: mujoco.MjSpec, model: mujoco.MjModel, base: int) -> None:
    """Add a ground plane, a light and a sky to a file whose static world has nothing to stand on.

    Args:
        spec: the spec to extend.
        model: the same, compiled before anything was added.
        base: id of the floating body; the light follows it, so that its shadow stays sharp.
    """
    static = model.body_weldid[model.geom_bodyid] == 0
    if np.any(static & ((model.geom_contype != 0) | (model.geom_conaffinity != 0))):
        return
    spec.add_texture(
        name="fbid_sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.62, 0.74, 0.88],
        rgb2=[0.95, 0.96, 0.98],
        width=64,
        height=384,
    )
    spec.add_texture(
        name="fbid_ground",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.86, 0.87, 0.88],
        rgb2=[0.78, 0.80, 0.82],
        width=512,
        height=512,
    )
    size = _extent(model, base)
    tiles = 1.0 / size  # one pair of tiles per robot size
    material = spec.add_material(name="fbid_ground", texuniform=True, texrepeat=[tiles, tiles])
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "fbid_ground"
    body = next(b for b in spec.bodies if b.id == base)
    body.add_light(
        name="fbid_sun",
        mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK,
        type=mujoco.mjtLightType.mjLIGHT_SPOT,
        pos=[1.2 * size, -1.6 * size, 4.0 * size],
        dir=[-1.2, 1.6, -4.0],
        cutoff=40,
        exponent=4,
        diffuse=[0.6, 0.6, 0.6],
        specular=[0.2, 0.2, 0.2],
    )
    # The renderer's near plane and shadow map are in units of the extent.
    spec.stat.extent = size
    spec.stat.center = [0, 0, 0.5 * size]
    spec.visual.headlight.ambient = [0.4, 0.4, 0.4]
    spec.visual.headlight.diffuse = [0.35, 0.35, 0.35]
    spec.visual.quality.shadowsize = 4096
    spec.visual.global_.offwidth = max(spec.visual.global_.offwidth, 1920)
    spec.visual.global_.offheight = max(spec.visual.global_.offheight, 1080)
    # contype and conaffinity 1, so that it meets a geom which has either.
    spec.worldbody.add_geom(
        name="fbid_ground",
        type=_GEOM.mjGEOM_PLANE,
        size=[0, 0, 0.1],
        contype=1,
        conaffinity=1,
        material="fbid_ground",
    )


def add_contact_sensors(spec: mujoco.MjSpec, feet: list[list[ContactPoint]]) -> list[str]:
    """Add one sensor per contact point: net contact force on the robot there, world frame, N.

    MuJoCo's contact sensor reports the force that the first matched object exerts on the second, so
    the robot is named second. A geom point counts the contacts of its geom. A site point counts the
    contacts of its body within a ball about the site: half the distance to the nearest other point of
    the foot, so that no contact counts twice; a foot with a single site counts all of its body's.

    Returns:
        Names of the sensors, in the order of the points.
    """
    bodies = {body.id: body for body in spec.bodies}
    names = []
    for foot in feet:
        for point in foot:
            name = f"fbid_contact_{len(names)}"
            if point.kind == _OBJ.mjOBJ_GEOM:
                first, second = {}, {"reftype": _OBJ.mjOBJ_GEOM, "refname": point.name}
            else:
                body = bodies[point.body]
                if not body.name:
                    body.name = f"fbid_foot_body_{point.body}"
                first, second = {}, {"reftype": _OBJ.mjOBJ_BODY, "refname": body.name}
                if len(foot) > 1:
                    gap = min(
                        float(np.linalg.norm(point.position - other.position))
                        for other in foot
                        if other is not point
                    )
                    body.add_site(
                        name=name,
                        pos=point.position,
                        type=_GEOM.mjGEOM_SPHERE,
                        size=[0.5 * gap, 0, 0],
                        group=5,
                    )
                    first = {"objtype": _OBJ.mjOBJ_SITE, "objname": name}
            sensor = spec.add_sensor(
                name=name, type=mujoco.mjtSensor.mjSENS_CONTACT, **first, **second
            )
            # data="force", reduce="netforce", num="1"
            sensor.intprm[:3] = [1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3, 1]
            names.append(name)
    return names


def _extent(model: mujoco.MjModel, base: int) -> float:
    """Size of the robot in its reference pose, m: twice the reach of its bodies from the base."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    tree = model.body_rootid == base
    reach = np.linalg.norm(data.xpos[tree] - data.xpos[base], axis=1)
    return float(max(2.0 * np.max(reach), 0.1))


def _not_a_motor(model: mujoco.MjModel, a: int) -> str:
    """Say why actuator `a` is not a plain torque motor; an empty string if it is one."""
    transmission = mujoco.mjtTrn(model.actuator_trntype[a])
    if transmission not in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
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
    """Symmetric torque limit of actuator `a` on joint `j`, N m. Raises `RobotError` if there is none."""
    scale, gear = model.actuator_gear[a, 0] * model.actuator_gainprm[a, 0], model.actuator_gear[a, 0]
    ranges = []
    if model.actuator_ctrllimited[a]:
        ranges.append(scale * model.actuator_ctrlrange[a])
    if model.actuator_forcelimited[a]:
        ranges.append(gear * model.actuator_forcerange[a])
    if model.jnt_actfrclimited[j]:
        ranges.append(model.jnt_actfrcrange[j])
    name = object_name(model, _OBJ.mjOBJ_ACTUATOR, a)
    if not ranges:
        raise RobotError(
            f"Motor {name!r} has no torque limit. Give it a ctrlrange or forcerange, or its joint an "
            "actuatorfrcrange."
        )
    low = max(float(np.min(r)) for r in ranges)
    high = min(float(np.max(r)) for r in ranges)
    limit = min(-low, high)
    if not (np.isfinite(limit) and limit > 0):
        raise RobotError(
            f"Motor {name!r} has the torque range [{low:g}, {high:g}]. Expected a finite range on both "
            "sides of 0."
        )
    return limit


def _listed(names: list[str]) -> str:
    """Names as they appear in messages."""
    return ", ".join(names) if names else "(none)"
