"""Where a body's geometry touches level ground: the contact points of a foot that names none."""

from collections.abc import Sequence

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots.mjcf import can_touch, object_name
from fbid_gym.robots.polygon import few_corners

_GEOM = mujoco.mjtGeom
_OBJ = mujoco.mjtObj
_UP = np.array([0.0, 0.0, 1.0])

_LEVEL = 0.01
"""Of the height of the centre of mass: what lies no higher above the lowest point touches, too."""

_CIRCLE = 8  # points that stand for one


def welded_geoms(model: mujoco.MjModel, body: int) -> np.ndarray:
    """Ids of the geoms that can touch, of a body and of what is welded to it."""
    welded = model.body_weldid[model.geom_bodyid] == model.body_weldid[body]
    return np.flatnonzero(welded & can_touch(model))


def lowest(model: mujoco.MjModel, data: mujoco.MjData, geoms: Sequence[int] | np.ndarray) -> float:
    """World height of the lowest point of some geoms, m; infinite for none."""
    ends = [ends_of(model, data, int(geom)) for geom in geoms]
    return min((float(np.min(points[:, 2]) - radius) for points, radius in ends), default=np.inf)


def touching_points(
    model: mujoco.MjModel, data: mujoco.MjData, body: int
) -> tuple[np.ndarray, float]:
    """Find the points by which a body, and what is welded to it, touches level ground.

    Spheres touch at one point, lying capsules at two, boxes at corners, meshes and many small geoms
    at the corners of their hull: no more than four to eight of them.

    Args:
        model: the model.
        data: kinematics of the home pose.
        body: id of the body.

    Returns:
        Points (P, 3) m, in the body's frame, in counterclockwise order; and the radius (m) of the
        spheres that they are the centres of, 0 if they are not.

    Raises:
        RobotError: nothing on the body can touch.
    """
    geoms = welded_geoms(model, body)
    if not geoms.size:
        name = object_name(model, _OBJ.mjOBJ_BODY, body)
        raise RobotError(
            f"Body {name!r} has no geometry that can touch the ground (contype and conaffinity "
            "are 0). Name sites where it shall, or give it a geom that collides."
        )
    ends = [ends_of(model, data, int(geom)) for geom in geoms]
    points = np.concatenate([found for found, _ in ends])
    radius = np.concatenate([np.full(len(found), size) for found, size in ends])
    height = points[:, 2] - radius
    root = model.body_rootid[body]
    standing = data.subtree_com[root][2] - height.min()
    touching = height <= height.min() + _LEVEL * max(standing, 0.0)
    points, radius = points[touching], radius[touching]
    if np.ptp(radius) > 0.0:
        points, radius = points - radius[:, None] * _UP, np.zeros(len(points))
    points = points[few_corners(points[:, :2])]
    rotation = data.xmat[body].reshape(3, 3)
    return (points - data.xpos[body]) @ rotation, float(radius[0])


def ends_of(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> tuple[np.ndarray, float]:
    """Return points (K, 3) m, world, and a radius: a geom lies within spheres about the points."""
    place, rotation = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
    size, kind = model.geom_size[geom], int(model.geom_type[geom])
    if kind == _GEOM.mjGEOM_SPHERE:
        return place[None].copy(), float(size[0])
    if kind == _GEOM.mjGEOM_CAPSULE:
        return place + np.array([[-size[1]], [size[1]]]) * rotation[:, 2], float(size[0])
    if kind == _GEOM.mjGEOM_BOX:
        local = size * (np.array(list(np.ndindex(2, 2, 2))) * 2.0 - 1.0)
    elif kind == _GEOM.mjGEOM_CYLINDER:
        local = _rims(size, rotation[2])
    elif kind == _GEOM.mjGEOM_ELLIPSOID:
        local = -(size**2 * rotation[2] / np.linalg.norm(size * rotation[2]))[None]
    elif kind == _GEOM.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        local = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(float)
    else:
        local = np.array([[0.0, 0.0, np.inf]])  # planes and height fields are no feet
        return local, 0.0
    return place + local @ rotation.T, 0.0


def _rims(size: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Points (K, 3) m on both rims of a cylinder, its lowest ones among them; `up` in its frame."""
    first = np.arctan2(-up[1], -up[0])
    angle = first + 2.0 * np.pi * np.arange(_CIRCLE) / _CIRCLE
    circle = size[0] * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.concatenate(
        [np.column_stack([circle, np.full(_CIRCLE, end)]) for end in (-size[1], size[1])]
    )
