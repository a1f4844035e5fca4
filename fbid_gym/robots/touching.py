"""Points at which bodies touch level ground: the feet, where nobody named them."""

from collections.abc import Iterable, Sequence

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.measured_model import LEGS, MeasuredModel
from fbid_gym.robots.mjcf import listed
from fbid_gym.robots.polygon import few_corners

_GEOM = mujoco.mjtGeom
_UP = np.array([0.0, 0.0, 1.0])

_FINGER = 0.005  # share of the robot's mass below which a limb is a finger
_SMALL = 0.15  # width of a round foot, in heights of the centre of mass, above which it is a sole
# A body tips by no more than this: farther, and it is not its sole that comes down.
_TIPS = np.radians(45.0)
TILTED = np.radians(5.0)  # soles that are tilted by more are not stood on
_SIDE = 0.1  # share of all its surface that a side of a body must have to stand on it
_SAME = 1e-3  # of normals that are one side's
_DEPTHS = (1.0, 2.0, 4.0)
_SHALLOW = 1.0 / 16.0
_TURNS = (0.0, -1.0, -0.5, 0.5, 1.0)  # rad
_ROUND = 0.05  # of a wheel's radius
# What lies no higher above the lowest point, in heights of the centre of mass, touches, too.
_LEVEL = 0.01


def bodies_of_feet(home: MeasuredModel) -> list[int]:
    """Return ids of the feet: the lowest bodies at the end of each limb; RobotError for none.

    A limb ends where nothing that moves by itself hangs on. Those that reach down as far as the
    lowest, give or take a seventh of the height of the centre of mass, are legs; not fingers, which
    are light, beside others that are not.
    """
    heights = {end: home.lowest(home.welded_geoms(end)) for end in home.limb_ends}
    ground = min(heights.values(), default=np.inf)
    if not np.isfinite(ground):
        raise RobotError(
            f"No feet found: no limb ends in a geom that can touch the ground; they end in "
            f"{', '.join(map(home.body_name, heights)) or '(none)'}. Name the feet: feet=[...]."
        )
    near = ground + LEGS * max(home.com[2] - ground, 0.0)
    legs = [end for end, height in heights.items() if height <= near]
    whole = home.model.body_subtreemass[home.base]
    legs = [end for end in legs if home.limb_mass(end) > _FINGER * whole] or legs
    lowest = [min(home.welded_geoms(end), key=lambda geom: home.lowest([geom])) for end in legs]
    return [int(home.model.geom_bodyid[geom]) for geom in lowest]


def _ball(points: np.ndarray, height: np.ndarray, above: float) -> tuple[np.ndarray, float] | None:
    """Find whether a foot is round and small, so that it rolls on one point.

    What is round has ever less of it near the ground: a quarter of the width at a sixteenth of the
    depth. A sole has all of it; what is large rocks on its edges. `points` (K, 3) m, world, lie on
    its surface, or are centres of spheres, with lowest ends at `height` (K,) m; the centre of mass
    is at `above`. Returns the lowest point (3,) and an estimate of the radius, m; else None.
    """
    low = float(height.min())
    depth = _LEVEL * max(above - low, 0.0)
    near, nearest = (points[height <= low + part * depth][:, :2] for part in (1.0, _SHALLOW))
    if len(near) < 2:
        return None
    axes = np.linalg.svd(near - near.mean(axis=0))[2]
    wide, narrow = np.ptp(near @ axes.T, axis=0), np.ptp(nearest @ axes.T, axis=0)
    round_ones = narrow <= 0.5 * wide
    round_ones |= wide < 0.1 * wide.max()  # a line
    if wide.max() > _SMALL * (above - low) or not round_ones.any():
        return None
    middle = 0.5 * (nearest.min(axis=0) + nearest.max(axis=0))
    size = 0.0
    for down in depth * np.array(_DEPTHS):  # few vertices lie at each
        part = points[height <= low + down][:, :2] @ axes.T[:, round_ones]
        half = 0.5 * float(np.ptp(part, axis=0).max())
        size = max(size, (half**2 + down**2) / (2.0 * down))
    return np.append(middle, low), size


def _is_flat(home: MeasuredModel, body: int, geoms: np.ndarray, low: float) -> bool:
    """Whether boxes and meshes that touch have a flat side, on whose edge they may be."""
    flat = np.isin(home.model.geom_type[geoms], (int(_GEOM.mjGEOM_BOX), int(_GEOM.mjGEOM_MESH)))
    depth = _LEVEL * (home.com[2] - low)
    touch = [int(geom) for geom in geoms[flat] if home.lowest([geom]) <= low + depth]
    return bool(touch) and side_below(home, body, touch) is not None


def tilt_of(pose: MeasuredModel, body: int) -> float | None:
    """Return how far the flat side of a body that faces down the most is from level, rad.

    None where no side of some size is nearer to that than to upright.
    """
    side = side_below(pose, body)
    return None if side is None else float(np.arccos(np.clip(-side[2], -1.0, 1.0)))


def side_below(
    pose: MeasuredModel, body: int, geoms: Sequence[int] | np.ndarray | None = None
) -> np.ndarray | None:
    """Outward normal (3,), world, of the flat side of a body that faces down the most.

    None where no side of some size does by `_TIPS`. Sides are those of some geoms; by default, of
    all that can touch, with what is welded to the body.
    """
    geoms = pose.welded_geoms(body) if geoms is None else geoms
    # Half a second that only those who ask should wait for.
    from scipy.spatial import ConvexHull, QhullError

    places = [pose.ends_of(int(geom))[0] for geom in geoms]
    # Flat ones have a volume with the joint that they hang from.
    moving = pose.model.body_weldid[body]
    places += [pose.data.xanchor[j][None] for j in np.flatnonzero(pose.model.jnt_bodyid == moving)]
    try:
        hull = ConvexHull(np.concatenate(places))
    except (QhullError, ValueError):
        return None
    normals, corners = hull.equations[:, :3], hull.points[hull.simplices]
    edges = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(edges, axis=1)
    _, side = np.unique(np.round(normals / _SAME), axis=0, return_inverse=True)
    normals = normals[np.bincount(side, areas)[side] > _SIDE * areas.sum()]
    lowest = normals[np.argmin(normals[:, 2])] if len(normals) else _UP
    return lowest if -lowest[2] > np.cos(_TIPS) else None


def refuse_wheels(home: MeasuredModel, bodies: Iterable[int]) -> None:
    """Refuse feet that turn about themselves: turned by their last hinge they touch as before."""
    wheels = [home.body_name(body) for body in bodies if _is_wheel(home, body)]
    if wheels:
        raise RobotError(
            f"Feet {listed(wheels)} turn about themselves, as wheels do, which no gait steps on. "
            "Expected feet that do not: lock their joints, or name others by feet=[...]."
        )


def _is_wheel(home: MeasuredModel, body: int) -> bool:
    model, geoms = home.model, home.welded_geoms(body)
    hinges = [j for j in home.hinges_above(body) if model.jnt_bodyid[j] == model.body_weldid[body]]
    hinges = [j for j in hinges if not model.jnt_limited[j]]
    if not geoms.size or not hinges or abs(home.data.xaxis[hinges[-1]][2]) > 0.5:
        return False
    drops = []
    for turn in _TURNS:
        qpos = home.qpos.copy()
        qpos[model.jnt_qposadr[hinges[-1]]] += turn
        pose = MeasuredModel(model, qpos)
        drops.append(float(pose.data.xanchor[hinges[-1]][2]) - pose.lowest(geoms))
    return bool(np.ptp(drops) < _ROUND * abs(drops[0]))


def touching_points(home: MeasuredModel, body: int) -> tuple[np.ndarray, float]:
    """Find the points by which a body, and what is welded to it, touches level ground.

    Spheres touch at one point, lying capsules at two, boxes at corners, meshes and many small geoms
    at the corners of their hull: no more than four to eight of them. What is round, and small, is
    one sphere, be it a mesh, a cylinder or a capsule. Raises RobotError where nothing can touch.

    Returns points (P, 3) m, in the body's frame, in counterclockwise order; and the radius (m) of
    the spheres that they are the centres of, 0 if they are not.
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
    ball = _ball(points, height, home.com[2])
    if ball is not None and not _is_flat(home, body, geoms, float(height.min())):
        size = max(ball[1], float(radius[height.argmin()]), home.roundness(geoms))
        return (ball[0] + size * _UP - home.data.xpos[body])[None] @ home.rotation(body), size
    touching = height <= height.min() + _LEVEL * max(home.com[2] - height.min(), 0.0)
    points, radius = points[touching], radius[touching]
    if np.ptp(radius) > 0.0:
        points, radius = points - radius[:, None] * _UP, np.zeros(len(points))
    points = points[few_corners(points[:, :2])]
    return (points - home.data.xpos[body]) @ home.rotation(body), float(radius[0])
