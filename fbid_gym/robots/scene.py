"""The ground and the light that are added to a robot's MJCF."""

import copy
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from fbid_gym.robots.feet import Foot, contacts
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.mjcf import unused

_GEOM = mujoco.mjtGeom
_DOWN = np.array([0.0, 0.0, -1.0])
_EMPTY = mujoco.MjSpec()
_PLAIN = _EMPTY.worldbody.add_geom()
_INHERITED = (
    *("condim", "friction", "priority", "solref", "solimp", "solmix", "margin", "gap"),
    *("group", "rgba"),
)


def heights_below(home: MeasuredModel, feet: Sequence[Foot]) -> np.ndarray:
    """Return how high the ground is below each contact point: (P,) m, NaN where there is none.

    Ground is what does not move and touches the feet. What lies higher than the centre of mass is
    none.
    """
    model, ground = home.model, home.ground
    own = np.concatenate([home.welded_geoms(foot.body) for foot in feet])
    if own.size:
        ground = ground & home.meeting(own).any(axis=1)
    # Rays meet the geoms of some groups alone, none that is invisible, of planes what is drawn.
    seen = copy.copy(model)
    seen.geom_group[:], seen.geom_matid[:], seen.geom_rgba[:, 3] = ground, -1, 1.0
    seen.geom_size[model.geom_type == _GEOM.mjGEOM_PLANE, :2] = 0.0
    groups, met = np.array([0, 1, 0, 0, 0, 0], np.uint8), np.zeros(1, np.int32)
    top, found = home.com[2], []
    for point in contacts(feet, home.data):
        above = np.array([*point[:2], top])
        distance = mujoco.mj_ray(seen, home.data, above, _DOWN, groups, 1, -1, met)
        found.append(top - distance if distance >= 0.0 else np.nan)
    return np.array(found)


def add_ground(
    spec: mujoco.MjSpec, home: MeasuredModel, base: mujoco.MjsBody, feet: Sequence[Foot]
) -> None:
    """Add a ground plane, a light and a sky to a file whose static world has nothing to stand on.

    The light follows the base, the floating body, so that its shadow stays sharp.
    """
    screen = spec.visual.global_
    screen.offwidth, screen.offheight = max(screen.offwidth, 1920), max(screen.offheight, 1080)
    if not np.isnan(heights_below(home, feet)).all():
        return
    sky, sun = unused("fbid_sky", spec.textures), unused("fbid_sun", spec.lights)
    ground = unused("fbid_ground", (*spec.textures, *spec.materials, *spec.geoms))
    kind, built_in = mujoco.mjtTexture, mujoco.mjtBuiltin
    fading = {"type": kind.mjTEXTURE_SKYBOX, "builtin": built_in.mjBUILTIN_GRADIENT}
    fading |= {"rgb1": [0.62, 0.74, 0.88], "rgb2": [0.95, 0.96, 0.98]}
    spec.add_texture(name=sky, **fading, width=64, height=384)
    checked = {"type": kind.mjTEXTURE_2D, "builtin": built_in.mjBUILTIN_CHECKER}
    checked |= {"rgb1": [0.86, 0.87, 0.88], "rgb2": [0.78, 0.80, 0.82]}
    spec.add_texture(name=ground, **checked, width=512, height=512)
    size = _extent(home.model)
    tiles = 1.0 / size  # one pair of tiles per robot size
    material = spec.add_material(name=ground, texuniform=True, texrepeat=[tiles, tiles])
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = ground
    follows = {"mode": mujoco.mjtCamLight.mjCAMLIGHT_TRACK, "dir": [-1.2, 1.6, -4.0]}
    spot = {"type": mujoco.mjtLightType.mjLIGHT_SPOT, "cutoff": 40, "exponent": 4}
    shine = {"diffuse": [0.6, 0.6, 0.6], "specular": [0.2, 0.2, 0.2]}
    place = [1.2 * size, -1.6 * size, 4.0 * size]
    base.add_light(name=sun, pos=place, **follows, **spot, **shine)
    # The renderer's near plane and shadow map are in units of the extent.
    spec.stat.extent = size
    spec.stat.center = [0, 0, 0.5 * size]
    spec.visual.headlight.ambient = [0.4, 0.4, 0.4]
    spec.visual.headlight.diffuse = [0.35, 0.35, 0.35]
    spec.visual.quality.shadowsize = 2048
    plane = {"name": ground, "material": ground, "type": _GEOM.mjGEOM_PLANE, "size": [0, 0, 0.1]}
    add_solid(spec, collision_bits(spec), **plane)


def collision_bits(spec: mujoco.MjSpec) -> int:
    """Return the bits by which any of the geoms of a file touches another."""
    bits = [geom.contype | geom.conaffinity for geom in spec.geoms]
    return int(np.bitwise_or.reduce([1, *bits]))


def add_solid(spec: mujoco.MjSpec, bits: int, **geom: Any) -> None:
    """Add a geom of these attributes to the static world, which meets geoms of these bits.

    It is as MuJoCo makes it: the file's own defaults are meant for the robot's geoms.
    """
    usual = {name: getattr(_PLAIN, name) for name in _INHERITED}
    spec.worldbody.add_geom(**usual, contype=bits, conaffinity=bits, **geom)


def _extent(model: mujoco.MjModel) -> float:
    """Size of the robot in its reference pose, m: twice the reach of its bodies from the base."""
    pose = MeasuredModel(model, model.qpos0)
    places = pose.data.xpos[model.body_rootid == pose.base]
    reach = np.linalg.norm(places - pose.data.xpos[pose.base], axis=1)
    return float(max(2.0 * np.max(reach), 0.1))
