"""What a robot of a file has below its feet at home."""

import copy
from collections.abc import Sequence

import mujoco
import numpy as np

from fbid_gym.robots.feet import Foot, contacts
from fbid_gym.robots.measured_model import MeasuredModel

_PLANE = mujoco.mjtGeom.mjGEOM_PLANE
_DOWN = np.array([0.0, 0.0, -1.0])


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
    seen.geom_size[model.geom_type == _PLANE, :2] = 0.0
    groups, met = np.array([0, 1, 0, 0, 0, 0], np.uint8), np.zeros(1, np.int32)
    top, found = home.com[2], []
    for point in contacts(feet, home.data):
        above = np.array([*point[:2], top])
        distance = mujoco.mj_ray(seen, home.data, above, _DOWN, groups, 1, -1, met)
        found.append(top - distance if distance >= 0.0 else np.nan)
    return np.array(found)
