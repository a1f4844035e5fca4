"""Feet and their contact points: found by name in a compiled model and checked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from fbid_gym.errors import InvalidValueError, RobotError
from fbid_gym.robots.mjcf import listed, object_name

_GEOM = mujoco.mjtGeom
_OBJ = mujoco.mjtObj

MAX_POINTS_PER_FOOT = 8
"""More add no force a rigid foot can use (four corners span its 6 dimensions) but cost time."""

_DISTINCT = 1e-6  # m


@dataclass(frozen=True, eq=False)
class Foot:
    """A rigid body with named contact points.

    Attributes:
        name: the foot's name.
        body: MuJoCo id of the body that carries the points.
        point_names: P names of sites or geoms.
        points: (P, 3) m, body frame: positions of sites, centres of spheres.
        radius: m. 0 for sites; for spheres their radius: the contact lies `radius` below
            (world -z) the point.
    """

    name: str
    body: int
    point_names: tuple[str, ...]
    points: np.ndarray
    radius: float

    @property
    def num_points(self) -> int:
        """Number of contact points."""
        return len(self.point_names)


@dataclass(frozen=True, eq=False)
class ContactPoint:
    """One contact point of a foot, as found in the compiled model.

    Attributes:
        name: name of the site or geom.
        is_site: whether it is a site; else a sphere, or the end of a capsule.
        body: id of the body that carries it.
        position: (3,) m, in the body's frame.
        radius: m. 0 for a site.
    """

    name: str
    is_site: bool
    body: int
    position: np.ndarray
    radius: float


def group_points(feet: Mapping[str, Sequence[str]] | Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Bring both ways of naming feet into one form.

    Args:
        feet: foot name -> names of its points, or a sequence of names, each a one-point foot.

    Returns:
        Foot name -> names of its points.

    Raises:
        InvalidValueError: neither form, or no foot.
        RobotError: a foot or point given twice, or too few or too many points on a foot.
    """
    expected = "foot name -> names of its sites or sphere geoms, or a list of such names"
    if isinstance(feet, str) or not isinstance(feet, Mapping | Sequence):
        raise InvalidValueError("feet", feet, expected)
    if isinstance(feet, Mapping):
        groups = {foot: (p,) if isinstance(p, str) else tuple(p) for foot, p in feet.items()}
    else:
        if len(set(feet)) < len(feet):
            raise RobotError(
                f"Foot {_first_repeated(feet)!r} is given twice. Expected distinct feet."
            )
        groups = {foot: (foot,) for foot in feet}
    if not groups:
        raise InvalidValueError("feet", feet, f"at least one foot: {expected}")
    every = [name for names in groups.values() for name in names]
    if not all(isinstance(name, str) for name in [*groups, *every]):
        raise InvalidValueError("feet", feet, expected)
    for foot, names in groups.items():
        if not 1 <= len(names) <= MAX_POINTS_PER_FOOT:
            raise RobotError(
                f"Foot {foot!r} has {len(names)} contact points. "
                f"Expected 1 to {MAX_POINTS_PER_FOOT}."
            )
    if len(set(every)) < len(every):
        raise RobotError(
            f"Contact point {_first_repeated(every)!r} is given twice. Expected distinct points."
        )
    return groups


def find_foot(model: mujoco.MjModel, foot: str, names: Sequence[str]) -> list[ContactPoint]:
    """Find the contact points of one foot, rigid to each other and alike.

    Raises:
        RobotError: a point cannot be used, or they lie on different bodies or at the same place,
            mix sites and geoms, or have different radii.
    """
    points = [_find_point(model, name) for name in names]
    if len({p.body for p in points}) > 1:
        where = ", ".join(
            f"{p.name} on {object_name(model, _OBJ.mjOBJ_BODY, p.body)}" for p in points
        )
        raise RobotError(
            f"Foot {foot!r} has points on different bodies: {where}. Expected one body."
        )
    if len({p.is_site for p in points}) > 1:
        kinds = ", ".join(f"{p.name} ({'site' if p.is_site else 'geom'})" for p in points)
        raise RobotError(f"Foot {foot!r} mixes sites and geoms: {kinds}. Expected one kind.")
    for i, first in enumerate(points):
        for second in points[:i]:
            if np.linalg.norm(first.position - second.position) < _DISTINCT:
                raise RobotError(
                    f"Foot {foot!r} has points at the same place: {second.name}, {first.name}. "
                    "Expected distinct points."
                )
    if len({p.radius for p in points}) > 1:
        radii = ", ".join(f"{p.name} {p.radius:g} m" for p in points)
        raise RobotError(
            f"Foot {foot!r} has spheres of different radii: {radii}. Expected one radius."
        )
    return points


def point_names(model: mujoco.MjModel) -> list[str]:
    """Names that can serve as contact points: the robot's sites, sphere and capsule geoms."""
    names = [
        mujoco.mj_id2name(model, _OBJ.mjOBJ_SITE, i)
        for i in range(model.nsite)
        if model.body_weldid[model.site_bodyid[i]] != 0
    ]
    names += [
        mujoco.mj_id2name(model, _OBJ.mjOBJ_GEOM, i)
        for i in range(model.ngeom)
        if model.body_weldid[model.geom_bodyid[i]] != 0
        and int(model.geom_type[i]) in (_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_CAPSULE)
    ]
    return sorted({name for name in names if name})


def _find_point(model: mujoco.MjModel, name: str) -> ContactPoint:
    """Find a contact point: a site, a sphere, or the end of a capsule.

    A capsule counts by its end farther from the body's origin: the tip of a leg. Where a site and a
    geom share the name, the site is meant.
    """
    site = mujoco.mj_name2id(model, _OBJ.mjOBJ_SITE, name)
    geom = mujoco.mj_name2id(model, _OBJ.mjOBJ_GEOM, name)
    if site < 0 and geom < 0:
        raise RobotError(f"No site or geom {name!r}. Valid choices: {listed(point_names(model))}.")
    if site >= 0:
        body = int(model.site_bodyid[site])
        point = ContactPoint(name, True, body, model.site_pos[site].copy(), 0.0)
    else:
        body = int(model.geom_bodyid[geom])
        position, radius = model.geom_pos[geom].copy(), float(model.geom_size[geom, 0])
        if model.geom_type[geom] == _GEOM.mjGEOM_CAPSULE:
            half = model.geom_size[geom, 1] * _axis(model.geom_quat[geom])
            position = max(position + half, position - half, key=lambda p: float(p @ p))
        elif model.geom_type[geom] != _GEOM.mjGEOM_SPHERE:
            shape = _GEOM(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
            raise RobotError(
                f"Geom {name!r} is a {shape}, which has no single contact point. Name sites at its "
                f"corners instead, or one of: {listed(point_names(model))}."
            )
        point = ContactPoint(name, False, body, position, radius)
    if model.body_weldid[body] == 0:
        raise RobotError(
            f"Contact point {name!r} is fixed to the world. Valid choices: "
            f"{listed(point_names(model))}."
        )
    return point


def _axis(quaternion: np.ndarray) -> np.ndarray:
    """(3,) z axis of a frame."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)[:, 2]


def _first_repeated(names: Sequence[str]) -> str:
    return next(name for i, name in enumerate(names) if name in names[:i])
