"""Feet that nobody named: what stands on the ground at the ends of a robot's limbs."""

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.mjcf import object_name
from fbid_gym.robots.touching import lowest, welded_geoms

_OBJ = mujoco.mjtObj

_LEVEL = 0.15
"""Of the height of the centre of mass: limbs that end no higher above the lowest are legs."""


def bodies_of_feet(model: mujoco.MjModel, at_home: mujoco.MjData) -> list[int]:
    """Find the feet: the lowest bodies at the end of each limb.

    A limb ends where nothing that moves by itself hangs on. Those that reach down as far as the
    lowest, give or take a seventh of the height of the centre of mass, are legs.

    Args:
        model: the model.
        at_home: kinematics of the home pose.

    Returns:
        Ids of the bodies, one for each foot.

    Raises:
        RobotError: no limb ends in something that can touch the ground.
    """
    moving = [b for b in range(1, model.nbody) if model.body_weldid[b] == b]
    carries = {int(model.body_weldid[model.body_parentid[b]]) for b in moving}
    heights = {
        end: lowest(model, at_home, welded_geoms(model, end))
        for end in moving
        if end not in carries
    }
    ground = min(heights.values(), default=np.inf)
    if not np.isfinite(ground):
        ends = [object_name(model, _OBJ.mjOBJ_BODY, end) for end in heights]
        raise RobotError(
            f"No feet found: no limb ends in a geom that can touch the ground; they end in "
            f"{', '.join(ends) or '(none)'}. Name the feet: feet=[...]."
        )
    base = model.jnt_bodyid[0]
    near = ground + _LEVEL * (at_home.subtree_com[base][2] - ground)
    return [_lowest_body(model, at_home, end) for end in heights if heights[end] <= near]


def _lowest_body(model: mujoco.MjModel, at_home: mujoco.MjData, end: int) -> int:
    """Of bodies welded together, the one with the lowest geom."""
    geoms = welded_geoms(model, end)
    heights = [lowest(model, at_home, [geom]) for geom in geoms]
    return int(model.geom_bodyid[geoms[int(np.argmin(heights))]])
