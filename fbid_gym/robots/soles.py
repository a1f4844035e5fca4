"""Standing up on soles, where the pose to begin from tilts them: feet known by their bodies.

A foot that is tilted touches level ground with less than its sole: with an edge, a corner, or a
sliver of what is round. What it shall stand on is then what touches where the file draws it, with
its joints within their ranges or not, or as it is, each tipped until the flat side that comes down
first is level.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.feet import ContactPoint, Foot, foot_of, named_by_body, points_of_body
from fbid_gym.robots.mjcf import posed
from fbid_gym.robots.stand import standing_pose
from fbid_gym.robots.touching import ends_of, welded_geoms

_DOWN = np.array([0.0, 0.0, -1.0])

TILTED = np.radians(5.0)
"""Soles that are tilted by more are not stood on."""

_TIPS = np.radians(45.0)
"""A body tips by no more than this: farther, and it is not its sole that comes down."""

_NARROW = 0.05
"""Width per length below which points span no area."""

_LARGER = 1.2
"""Area, or length where there is none, by which what a foot may stand on is better."""

_SIDE = 0.1
"""Share of all its surface that a side of a body must have to stand on it."""

_SAME = 1e-3  # of normals that are one side's

Points = dict[str, list[ContactPoint]]


def stand_up(
    model: mujoco.MjModel,
    start: np.ndarray,
    points: Points,
    named: Mapping[str, Sequence[str]] | None,
) -> tuple[Points, np.ndarray]:
    """Find a standing pose, see `standing_pose`: on soles, where feet known by bodies have some.

    Args:
        model: compiled model.
        start: (nq,) the pose to begin with.
        points: of each foot, as it touches in that pose.
        named: how the feet were named; None: not at all.

    Returns:
        Points of each foot, and qpos (nq,).

    Raises:
        RobotError: no such pose was found.
    """
    soles = dict(points)
    for foot, found in points.items():
        if named is None or named_by_body(model, named[foot]):
            soles[foot] = _sole(model, start, foot, found)
    if soles != points:
        with suppress(RobotError):
            return soles, standing_pose(model, start, _feet(soles))
    return points, standing_pose(model, start, _feet(points))


def tilt_of(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> float | None:
    """Return how far the flat side of a body that faces down the most is from level, rad.

    None where no side of some size is nearer to that than to upright.
    """
    side = _side_below(model, data, body)
    return None if side is None else float(np.arccos(np.clip(-side[2], -1.0, 1.0)))


def _sole(
    model: mujoco.MjModel, start: np.ndarray, foot: str, found: list[ContactPoint]
) -> list[ContactPoint]:
    """What a foot shall stand on, of which `found` touches in the pose to begin with."""
    body, area = found[0].body, _extent(found)
    tilt = tilt_of(model, posed(model, start), body)
    if area[0] > 0.0 and tilt is not None and tilt <= TILTED:
        return found
    drawn = model.qpos0.copy()
    drawn[:7] = start[:7]
    tipped = [_tipped(model, pose, body) for pose in (drawn, start)]
    others = [points_of_body(model, posed(model, pose), foot, body) for pose in tipped]
    for size in range(2):
        for other in others:
            if _extent(other)[size] > _LARGER * area[size]:
                return other
        if area[size] > 0.0:
            break
    return found


def _extent(points: Sequence[ContactPoint]) -> tuple[float, float]:
    """Measures of the area that points span, 0 for a line, and of their length."""
    places = np.array([point.position for point in points])
    sizes = np.zeros(3)
    found = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    sizes[: len(found)] = found
    wide = sizes[1] > _NARROW * sizes[0]
    return float(wide * sizes[0] * sizes[1]), float(sizes[0])


def _tipped(model: mujoco.MjModel, pose: np.ndarray, body: int) -> np.ndarray:
    """The whole robot turned until the flat side of a body that comes down first is level."""
    turned, side = pose.copy(), _side_below(model, posed(model, pose), body)
    if side is not None:
        turned[3:7] = _turned(pose[3:7], side, _DOWN)
    return turned


def _side_below(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> np.ndarray | None:
    """Outward normal (3,), world, of the flat side of a body that faces down the most.

    Of a body with what is welded to it; None where no side of some size does by `_TIPS`.
    """
    # Half a second that only those who ask should wait for.
    from scipy.spatial import ConvexHull, QhullError

    places = [ends_of(model, data, int(geom))[0] for geom in welded_geoms(model, body)]
    # Flat ones have a volume with the joint that they hang from.
    moving = model.body_weldid[body]
    places += [data.xanchor[j][None] for j in np.flatnonzero(model.jnt_bodyid == moving)]
    try:
        hull = ConvexHull(np.concatenate(places))
    except (QhullError, ValueError):
        return None
    normals, corners = hull.equations[:, :3], hull.points[hull.simplices]
    edges = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = 0.5 * np.linalg.norm(edges, axis=1)
    _, side = np.unique(np.round(normals / _SAME), axis=0, return_inverse=True)
    normals = normals[np.bincount(side, areas)[side] > _SIDE * areas.sum()]
    lowest = normals[np.argmin(normals[:, 2])] if len(normals) else -_DOWN
    return lowest if -lowest[2] > np.cos(_TIPS) else None


def _turned(quaternion: np.ndarray, this: np.ndarray, onto: np.ndarray) -> np.ndarray:
    """An orientation, turned the shortest way that takes one unit vector (3,) onto another."""
    turn, result = np.append(1.0 + this @ onto, np.cross(this, onto)), np.empty(4)
    mujoco.mju_mulQuat(result, turn / np.linalg.norm(turn), quaternion)
    return result


def _feet(points: Points) -> list[Foot]:
    return [foot_of(name, found) for name, found in points.items()]
