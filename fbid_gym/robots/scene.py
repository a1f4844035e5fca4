"""What is added to a robot's MJCF: something to stand on, light, and contact-force sensors."""

import mujoco
import numpy as np

from fbid_gym.robots.feet import ContactPoint

_GEOM = mujoco.mjtGeom
_OBJ = mujoco.mjtObj


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
    contacts of its body within a ball about the site, half the distance to the nearest other point
    of the foot, so that no contact counts twice; a foot of a single site counts all its body's.

    Returns:
        Names of the sensors, in the order of the points.
    """
    bodies = {body.id: body for body in spec.bodies}
    names: list[str] = []
    for foot in feet:
        for point in foot:
            name = f"fbid_contact_{len(names)}"
            matched: dict[str, object] = {"reftype": _OBJ.mjOBJ_GEOM, "refname": point.name}
            if point.is_site:
                body = bodies[point.body]
                if not body.name:
                    body.name = f"fbid_foot_body_{point.body}"
                matched = {"reftype": _OBJ.mjOBJ_BODY, "refname": body.name}
            if point.is_site and len(foot) > 1:
                gaps = [
                    np.linalg.norm(point.position - other.position)
                    for other in foot
                    if other is not point
                ]
                body.add_site(
                    name=name,
                    pos=point.position,
                    type=_GEOM.mjGEOM_SPHERE,
                    size=[0.5 * float(min(gaps)), 0, 0],
                    group=5,
                )
                matched |= {"objtype": _OBJ.mjOBJ_SITE, "objname": name}
            sensor = spec.add_sensor(name=name, type=mujoco.mjtSensor.mjSENS_CONTACT, **matched)
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
