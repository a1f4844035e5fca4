"""Contact pairs named beforehand, in worlds where robots can meet nothing but planes.

MuJoCo sorts all bodies at every step to find which of them may touch. Where only planes can be met
there is nothing to find, and to name the pairs is cheaper.
"""

import mujoco
import numpy as np

from fbid_gym.robots.measured_model import MeasuredModel

_PLANE = mujoco.mjtGeom.mjGEOM_PLANE
_OBJ = mujoco.mjtObj
_FAR = 1e3  # m, beyond which no part of a robot is from its ground

# What a contact adds to the gap, or takes from it: MuJoCo's to sum up, and all but unused.
_BESIDES = ("geom_margin", "geom_gap", "geom_adhesion", "geom_surfacevel")

# Of a pair and of a contact.
_SHARED = ("friction", "solref", "solreffriction", "solimp")


def compile_paired(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a world whose contact pairs are named beforehand, if all of them are with planes.

    Which pairs there are and how they touch is what MuJoCo makes of the geoms. Contacts are the
    same, and the motion. Any other world is compiled as it is. Geoms without a name are given one.
    """
    for index, geom in enumerate(spec.geoms):
        geom.name = geom.name or f"fbid_geom_{index}"
    model = spec.compile()
    world = MeasuredModel(model, model.qpos0)
    if not _meets_planes_alone(world):
        return model
    near = world.with_contacts(_FAR, world.touching)
    contacts = {tuple(contact.geom.tolist()): contact for contact in near.contact}.values()
    met = {int(geom) for contact in contacts for geom in contact.geom}
    if met != set(np.flatnonzero(world.touching).tolist()):
        return model
    paired = spec.copy()
    for contact in contacts:
        first, second = (mujoco.mj_id2name(model, _OBJ.mjOBJ_GEOM, g) for g in contact.geom)
        how = {name: getattr(contact, name) for name in _SHARED}
        paired.add_pair(geomname1=first, geomname2=second, condim=contact.dim, **how)
    for geom in paired.geoms:
        geom.contype = geom.conaffinity = 0
    return paired.compile()


def _meets_planes_alone(world: MeasuredModel) -> bool:
    """Whether the moving geoms can touch nothing but planes, neither each other."""
    model = world.model
    if model.npair or model.nexclude or model.nflex:
        return False
    if any(getattr(model, name).any() for name in _BESIDES):
        return False
    moving = world.touching & ~world.ground
    others = moving | (world.ground & (model.geom_type != _PLANE))
    return bool(moving.any()) and not world.meeting(np.flatnonzero(moving))[others].any()
