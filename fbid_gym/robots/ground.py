"""What a robot of a file has below its feet at home."""

import copy
from collections.abc import Sequence

import mujoco
import numpy as np

from fbid_gym.robots.feet import Foot
from fbid_gym.robots.mjcf import static_geoms
from fbid_gym.robots.touching import welded_geoms

_PLANE = mujoco.mjtGeom.mjGEOM_PLANE
_DOWN = np.array([0.0, 0.0, -1.0])


def heights_below(model: mujoco.MjModel, home: mujoco.MjData, feet: Sequence[Foot]) -> np.ndarray:
    """Return how high the ground is below each contact point: (P,) m, NaN where there is none.

    Ground is what does not move and touches the feet. What lies higher than the centre of mass is
    none.

    Args:
        model: of a robot and its world.
        home: kinematics of the home pose.
        feet: of the robot.
    """
    # Rays meet the geoms of some groups alone, none that is invisible, of planes what is drawn.
    seen = copy.copy(model)
    seen.geom_group[:], seen.geom_matid[:], seen.geom_rgba[:, 3] = _meets(model, feet), -1, 1.0
    seen.geom_size[model.geom_type == _PLANE, :2] = 0.0
    groups, met = np.array([0, 1, 0, 0, 0, 0], np.uint8), np.zeros(1, np.int32)
    top, found = home.subtree_com[model.jnt_bodyid[0], 2], []
    for point in np.concatenate([foot.touching(home) for foot in feet]):
        above = np.array([*point[:2], top])
        distance = mujoco.mj_ray(seen, home, above, _DOWN, groups, 1, -1, met)
        found.append(top - distance if distance >= 0.0 else np.nan)
    return np.array(found)


def _meets(model: mujoco.MjModel, feet: Sequence[Foot]) -> np.ndarray:
    """(ngeom,) bool, geoms of the ground that touch what a foot touches with."""
    own = np.concatenate([welded_geoms(model, foot.body) for foot in feet])
    if not own.size:
        return static_geoms(model)
    types, affinities = model.geom_contype[own], model.geom_conaffinity[own]
    theirs = model.geom_contype[:, None] & affinities, model.geom_conaffinity[:, None] & types
    return static_geoms(model) & ((theirs[0] | theirs[1]) != 0).any(axis=1)
