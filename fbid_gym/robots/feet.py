"""Feet and their contact points: found in a compiled model and checked."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from fbid_gym.errors import InvalidValueError, RobotError
from fbid_gym.robots.limbs import bodies_of_feet
from fbid_gym.robots.mjcf import can_touch, listed, object_name, posed
from fbid_gym.robots.touching import touching_points

_GEOM = mujoco.mjtGeom
_OBJ = mujoco.mjtObj

MAX_POINTS_PER_FOOT = 8
"""More add no force a rigid foot can use (four corners span its 6 dimensions) but cost time."""

_DISTINCT = 1e-6  # m
_MIDDLE = 0.1  # of a sphere's radius
_ROUND = (_GEOM.mjGEOM_SPHERE, _GEOM.mjGEOM_CAPSULE)


@dataclass(frozen=True, eq=False)
class Foot:
    """A rigid body with named contact points.

    Attributes:
        name: the foot's name.
        body: MuJoCo id of the body that carries the points.
        point_names: P names, of sites or geoms where the points are such.
        points: (P, 3) m, body frame: places on the body's surface, or centres of spheres.
        radius: m. 0 for places; for spheres their radius: the contact lies `radius` below
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

    def touching(self, data: mujoco.MjData) -> np.ndarray:
        """Return where its points touch level ground: (P, 3) m, world."""
        rotation = data.xmat[self.body].reshape(3, 3)
        return data.xpos[self.body] + self.points @ rotation.T - [0.0, 0.0, self.radius]


@dataclass(frozen=True, eq=False)
class ContactPoint:
    """One contact point of a foot, as found in the compiled model.

    Attributes:
        name: name of the site or geom; of a point found by the body's shape, the foot's and a
            number.
        geom: id of the sphere or capsule that it is named after; -1 if it is a place on the body.
        body: id of the body that carries it.
        position: (3,) m, in the body's frame.
        radius: m. 0 for a place on the surface, else of the sphere about it.
    """

    name: str
    geom: int
    body: int
    position: np.ndarray
    radius: float


def group_points(feet: Mapping[str, Sequence[str]] | Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Bring both ways of naming feet into one form.

    Args:
        feet: foot name -> names of its points, or of its body; or a sequence of names, each of a
            foot with one point, or of its body.

    Returns:
        Foot name -> names of its points, or the one of its body.

    Raises:
        InvalidValueError: neither form, or no foot.
        RobotError: a foot or point given twice, or too few or too many points on a foot.
    """
    expected = (
        "foot name -> its body, or names of its sites or sphere geoms; or a list of such names"
    )
    if isinstance(feet, str) or not isinstance(feet, Mapping | Sequence):
        raise InvalidValueError("feet", feet, expected)
    given = list(feet.items()) if isinstance(feet, Mapping) else [(foot, foot) for foot in feet]
    if not given:
        raise InvalidValueError("feet", feet, f"at least one foot: {expected}")
    points = [(p,) if isinstance(p, str) else _listed(p) for _, p in given]
    every = [name for names in points for name in names]
    if not all(isinstance(name, str) for name in [*(foot for foot, _ in given), *every]):
        raise InvalidValueError("feet", feet, expected)
    groups = {foot: names for (foot, _), names in zip(given, points, strict=True)}
    if len(groups) < len(given):
        repeated = _first_repeated([foot for foot, _ in given])
        raise RobotError(f"Foot {repeated!r} is given twice. Expected distinct feet.")
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


def points_of_feet(
    model: mujoco.MjModel, qpos: np.ndarray, named: Mapping[str, Sequence[str]] | None
) -> dict[str, list[ContactPoint]]:
    """Find the contact points of the feet that are named, or of those that stand on the ground.

    Args:
        model: the model.
        qpos: (nq,) its home pose.
        named: see `group_points`; None: find the feet, too.

    Raises:
        RobotError: see `find_foot`, `bodies_of_feet`.
    """
    at_home = posed(model, qpos)
    if named is not None:
        return {foot: find_foot(model, at_home, foot, names) for foot, names in named.items()}
    found: dict[str, list[ContactPoint]] = {}
    for body in bodies_of_feet(model, at_home):
        foot = mujoco.mj_id2name(model, _OBJ.mjOBJ_BODY, body) or f"foot_{len(found)}"
        found[foot] = points_of_body(model, at_home, foot, body)
    return found


def foot_of(name: str, points: Sequence[ContactPoint]) -> Foot:
    """Return the foot with these points, of one body."""
    return Foot(
        name=name,
        body=points[0].body,
        point_names=tuple(point.name for point in points),
        points=np.array([point.position for point in points]),
        radius=points[0].radius,
    )


def named_by_body(model: mujoco.MjModel, names: Sequence[str]) -> bool:
    """Whether the names of a foot's points are one, and that of its body."""
    body = mujoco.mj_name2id(model, _OBJ.mjOBJ_BODY, names[0])
    return len(names) == 1 and body > 0 and not is_point(model, names[0])


def find_foot(
    model: mujoco.MjModel, at_home: mujoco.MjData, foot: str, names: Sequence[str]
) -> list[ContactPoint]:
    """Find the contact points of one foot, rigid to each other and alike.

    Args:
        model: the model.
        at_home: kinematics of the home pose, which say where a body touches level ground.
        foot: the foot's name.
        names: of its points; or of its body alone.

    Raises:
        RobotError: a point cannot be used, or they lie on different bodies or at the same place,
            mix sites and geoms, or have different radii.
    """
    if named_by_body(model, names):
        body = mujoco.mj_name2id(model, _OBJ.mjOBJ_BODY, names[0])
        return points_of_body(model, at_home, foot, body)
    points = [_find_point(model, name) for name in names]
    if len({p.body for p in points}) > 1:
        where = ", ".join(
            f"{p.name} on {object_name(model, _OBJ.mjOBJ_BODY, p.body)}" for p in points
        )
        raise RobotError(
            f"Foot {foot!r} has points on different bodies: {where}. Expected one body."
        )
    if len({p.geom < 0 for p in points}) > 1:
        kinds = ", ".join(f"{p.name} ({'site' if p.geom < 0 else 'geom'})" for p in points)
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


def points_of_body(
    model: mujoco.MjModel, at_home: mujoco.MjData, foot: str, body: int
) -> list[ContactPoint]:
    """Find the contact points of a foot by the shape of its body.

    Raises:
        RobotError: nothing on the body can touch, or the body is fixed to the world.
    """
    if model.body_weldid[body] == 0:
        raise RobotError(f"Body {foot!r} is fixed to the world. Expected a body of the robot.")
    positions, radius = touching_points(model, at_home, body)
    names = [foot] if len(positions) == 1 else [f"{foot}_{i}" for i in range(len(positions))]
    return [
        ContactPoint(name, -1, body, position, radius)
        for name, position in zip(names, positions, strict=True)
    ]


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
        if model.body_weldid[model.geom_bodyid[i]] != 0 and int(model.geom_type[i]) in _ROUND
    ]
    return sorted({name for name in names if name})


def body_names(model: mujoco.MjModel) -> list[str]:
    """Names of the robot's bodies that have something to touch the ground with."""
    bodies = sorted(set(model.geom_bodyid[can_touch(model)].tolist()))
    names = [
        mujoco.mj_id2name(model, _OBJ.mjOBJ_BODY, b) for b in bodies if model.body_weldid[b] != 0
    ]
    return [name for name in names if name]


def is_point(model: mujoco.MjModel, name: str) -> bool:
    """Whether a site or a sphere or capsule has this name."""
    geom = mujoco.mj_name2id(model, _OBJ.mjOBJ_GEOM, name)
    return mujoco.mj_name2id(model, _OBJ.mjOBJ_SITE, name) >= 0 or (
        geom >= 0 and int(model.geom_type[geom]) in _ROUND
    )


def _find_point(model: mujoco.MjModel, name: str) -> ContactPoint:
    """Find a contact point: a site, a sphere, or the end of a capsule.

    A capsule counts by its end farther from the body's origin: the tip of a leg. A site in the
    middle of a sphere that touches means the sphere, or it would be left in the ground; so does one
    that shares its name with a sphere or capsule that touches.
    """
    site = mujoco.mj_name2id(model, _OBJ.mjOBJ_SITE, name)
    geom = mujoco.mj_name2id(model, _OBJ.mjOBJ_GEOM, name)
    if site < 0 and geom < 0:
        raise RobotError(
            f"No site or geom {name!r}. Valid choices: {listed(point_names(model))}. A foot can "
            f"also be named by its body: {listed(body_names(model))}."
        )
    if site >= 0 and not (
        geom >= 0 and int(model.geom_type[geom]) in _ROUND and can_touch(model)[geom]
    ):
        body, position = int(model.site_bodyid[site]), model.site_pos[site].copy()
        point = ContactPoint(name, -1, body, position, _radius_about(model, body, position))
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
                f"corners instead, or its body, or one of: {listed(point_names(model))}."
            )
        point = ContactPoint(name, geom, body, position, radius)
    if model.body_weldid[body] == 0:
        raise RobotError(
            f"Contact point {name!r} is fixed to the world. Valid choices: "
            f"{listed(point_names(model))}."
        )
    return point


def _radius_about(model: mujoco.MjModel, body: int, place: np.ndarray) -> float:
    """Radius (m) of the sphere on a body whose middle is at a place (3,); 0 if there is none."""
    touching = (model.geom_bodyid == body) & can_touch(model)
    for geom in np.flatnonzero(touching & (model.geom_type == _GEOM.mjGEOM_SPHERE)):
        radius = float(model.geom_size[geom, 0])
        if np.linalg.norm(model.geom_pos[geom] - place) < _MIDDLE * radius:
            return radius
    return 0.0


def _axis(quaternion: np.ndarray) -> np.ndarray:
    """(3,) z axis of a frame."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)[:, 2]


def _listed(names: Any) -> tuple[Any, ...]:
    """What is given as names; what is none, by itself."""
    return tuple(names) if isinstance(names, Iterable) else (names,)


def _first_repeated(names: Sequence[str]) -> str:
    return next(name for i, name in enumerate(names) if name in names[:i])
