"""Where bodies touch level ground: the feet that nobody named, and points where none are named."""

import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.polygon import few_corners

_UP = np.array([0.0, 0.0, 1.0])

# Shares of the height of the centre of mass.
_LEGS = 0.15
"""Limbs that end no higher above the lowest are legs."""
_LEVEL = 0.01
"""What lies no higher above the lowest point touches, too."""


def bodies_of_feet(home: MeasuredModel) -> list[int]:
    """Find the feet: the lowest bodies at the end of each limb.

    A limb ends where nothing that moves by itself hangs on. Those that reach down as far as the
    lowest, give or take a seventh of the height of the centre of mass, are legs.

    Returns:
        Ids of the bodies, one for each foot.

    Raises:
        RobotError: no limb ends in something that can touch the ground.
    """
    heights = {end: home.lowest(home.welded_geoms(end)) for end in home.limb_ends}
    ground = min(heights.values(), default=np.inf)
    if not np.isfinite(ground):
        raise RobotError(
            f"No feet found: no limb ends in a geom that can touch the ground; they end in "
            f"{', '.join(map(home.body_name, heights)) or '(none)'}. Name the feet: feet=[...]."
        )
    near = ground + _LEGS * (home.com[2] - ground)
    lowest = [
        min(home.welded_geoms(end), key=lambda geom: home.lowest([geom]))
        for end, height in heights.items()
        if height <= near
    ]
    return [int(home.model.geom_bodyid[geom]) for geom in lowest]


def touching_points(home: MeasuredModel, body: int) -> tuple[np.ndarray, float]:
    """Find the points by which a body, and what is welded to it, touches level ground.

    Spheres touch at one point, lying capsules at two, boxes at corners, meshes and many small geoms
    at the corners of their hull: no more than four to eight of them.

    Returns:
        Points (P, 3) m, in the body's frame, in counterclockwise order; and the radius (m) of the
        spheres that they are the centres of, 0 if they are not.

    Raises:
        RobotError: nothing on the body can touch.
    """
    geoms = home.welded_geoms(body)
    if not geoms.size:
        raise RobotError(
            f"Body {home.body_name(body)!r} has no geometry that can touch the ground (contype and "
            "conaffinity are 0). Name sites where it shall, or give it a geom that collides."
        )
    ends = [home.ends_of(int(geom)) for geom in geoms]
    points = np.concatenate([found for found, _ in ends])
    radius = np.concatenate([np.full(len(found), size) for found, size in ends])
    height = points[:, 2] - radius
    touching = height <= height.min() + _LEVEL * max(home.com[2] - height.min(), 0.0)
    points, radius = points[touching], radius[touching]
    if np.ptp(radius) > 0.0:
        points, radius = points - radius[:, None] * _UP, np.zeros(len(points))
    points = points[few_corners(points[:, :2])]
    return (points - home.data.xpos[body]) @ home.rotation(body), float(radius[0])
