"""Standing up on soles, where the pose to begin from tilts them: feet known by their bodies.

A foot that is tilted touches level ground with an edge. What it shall stand on is then what is
level where the file draws it, with its joints within their ranges or not; or else the flat side
that comes down when it tips.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.feet import ContactPoint, Foot, foot_of, named_by_body, points_of_body
from fbid_gym.robots.mjcf import posed
from fbid_gym.robots.stand import standing_pose
from fbid_gym.robots.touching import ends_of, welded_geoms

_DOWN = np.array([0.0, 0.0, -1.0])

_NARROW = 0.05
"""Width per length below which points span no area."""

_SIDE = 0.1
"""Share of all its surface that a side of a body must have to stand on it."""

_SAME = 1e-3  # of normals that are one side's

_TIPS = np.radians(45.0)
"""A body tips by no more than this: farther, and it is not its sole that comes down."""

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
        by_shape = named is None or named_by_body(model, named[foot])
        if by_shape and not spans_area(foot_of(foot, found).points):
            soles[foot] = next(_soles(model, start, foot, found[0].body), found)
    if soles != points:
        with suppress(RobotError):
            return soles, standing_pose(model, start, _feet(soles))
    return points, standing_pose(model, start, _feet(points))


def spans_area(places: np.ndarray) -> bool:
    """Whether places (P, 3) are neither one nor in a line."""
    sizes = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    return len(sizes) > 1 and bool(sizes[1] > _NARROW * sizes[0])


def side_below(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, most: float
) -> np.ndarray | None:
    """Return the outward normal (3,), world, of the flat side of a body that faces down the most.

    Args:
        model: the model.
        data: its kinematics.
        body: with what is welded to it.
        most: rad between the normal and straight down.

    Returns:
        None where no flat side of some size faces down.
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
    return lowest if -lowest[2] > np.cos(most) else None


def _soles(
    model: mujoco.MjModel, start: np.ndarray, foot: str, body: int
) -> Iterator[list[ContactPoint]]:
    """What a foot may stand on: as the file draws it, and tipped."""
    drawn, tipped = model.qpos0.copy(), start.copy()
    drawn[:7] = start[:7]
    side = side_below(model, posed(model, start), body, _TIPS)
    if side is not None:
        tipped[3:7] = _turned(start[3:7], side, _DOWN)
    for pose in (drawn, tipped):
        found = points_of_body(model, posed(model, pose), foot, body)
        if spans_area(foot_of(foot, found).points):
            yield found


def _turned(quaternion: np.ndarray, this: np.ndarray, onto: np.ndarray) -> np.ndarray:
    """An orientation, turned the shortest way that takes one unit vector (3,) onto another."""
    turn, result = np.append(1.0 + this @ onto, np.cross(this, onto)), np.empty(4)
    mujoco.mju_mulQuat(result, turn / np.linalg.norm(turn), quaternion)
    return result


def _feet(points: Points) -> list[Foot]:
    return [foot_of(name, found) for name, found in points.items()]
