"""Feet and their contact points: found in a compiled model and checked."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from fbid_gym.errors import InvalidValueError, RobotError
from fbid_gym.robots.measured_model import MeasuredModel
from fbid_gym.robots.mjcf import listed
from fbid_gym.robots.touching import bodies_of_feet, touching_points

_GEOM = mujoco.mjtGeom
_OBJ = mujoco.mjtObj

MAX_POINTS_PER_FOOT = 8
"""More add no force a rigid foot can use (four corners span its 6 dimensions) but cost time."""

_DISTINCT = 1e-6  # m
_MIDDLE = 0.1  # of a sphere's radius


@dataclass(frozen=True, eq=False)
class Foot:
    """A rigid body with named contact points."""

    name: str
    body: int
    """MuJoCo id of the body that carries the points."""
    point_names: tuple[str, ...]
    """P names, of sites or geoms where the points are such."""
    points: np.ndarray
    """(P, 3) m, body frame: places on the body's surface, or centres of spheres."""
    radius: float
    """m. 0 for places; for spheres their radius: the contact lies so far below (world -z)."""
    geoms: tuple[int, ...] = ()
    """Ids of the spheres or capsules that the points are named after; empty for places."""

    @property
    def num_points(self) -> int:
        """Number of contact points."""
        return len(self.point_names)

    def touching(self, data: mujoco.MjData) -> np.ndarray:
        """Return where its points touch level ground: (P, 3) m, world."""
        rotation = data.xmat[self.body].reshape(3, 3)
        return data.xpos[self.body] + self.points @ rotation.T - [0.0, 0.0, self.radius]


def contacts(feet: Sequence[Foot], data: mujoco.MjData) -> np.ndarray:
    """Return where the contact points of all feet touch level ground: (P, 3) m, world."""
    return np.concatenate([foot.touching(data) for foot in feet])


def group_points(feet: Mapping[str, Sequence[str]] | Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return foot name -> names of its points, or the one of its body.

    Feet are given so, or as a sequence of names, each of a foot with one point, or of its body.

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
    points = [
        tuple(p) if isinstance(p, Iterable) and not isinstance(p, str) else (p,) for _, p in given
    ]
    names, every = [foot for foot, _ in given], [name for part in points for name in part]
    if not all(isinstance(name, str) for name in [*names, *every]):
        raise InvalidValueError("feet", feet, expected)
    _expect_distinct("Foot", "feet", names)
    for foot, part in zip(names, points, strict=True):
        if not 1 <= len(part) <= MAX_POINTS_PER_FOOT:
            raise RobotError(
                f"Foot {foot!r} has {len(part)} contact points. Expected 1 to "
                f"{MAX_POINTS_PER_FOOT}."
            )
    _expect_distinct("Contact point", "points", every)
    return dict(zip(names, points, strict=True))


def find_feet(home: MeasuredModel, named: Mapping[str, Sequence[str]] | None) -> tuple[Foot, ...]:
    """Find the feet that are named, see `group_points`; for None, those that stand on the ground.

    Points of a foot lie on one body at different places, and are alike. Raises RobotError for
    others, for a foot with nothing that can touch, and where no feet are found.
    """
    if named is not None:
        return tuple(_find_foot(home, foot, names) for foot, names in named.items())
    found: dict[str, Foot] = {}
    for body in bodies_of_feet(home):
        foot = mujoco.mj_id2name(home.model, _OBJ.mjOBJ_BODY, body) or f"foot_{len(found)}"
        found[foot] = foot_of_body(home, foot, body)
    return tuple(found.values())


def foot_of_body(home: MeasuredModel, name: str, body: int) -> Foot:
    """Find the contact points of a foot by the shape of its body, which has to touch and move."""
    if home.model.body_weldid[body] == 0:
        raise RobotError(f"Body {name!r} is fixed to the world. Expected a body of the robot.")
    points, radius = touching_points(home, body)
    names = [name] if len(points) == 1 else [f"{name}_{i}" for i in range(len(points))]
    return Foot(name, body, tuple(names), points, radius)


def named_by_body(model: mujoco.MjModel, names: Sequence[str]) -> bool:
    """Return whether the names of a foot's points are one, and that of its body."""
    body = mujoco.mj_name2id(model, _OBJ.mjOBJ_BODY, names[0])
    return len(names) == 1 and body > 0 and not is_point(model, names[0])


def is_point(model: mujoco.MjModel, name: str) -> bool:
    """Return whether a site or a sphere or capsule has this name."""
    geom = mujoco.mj_name2id(model, _OBJ.mjOBJ_GEOM, name)
    return mujoco.mj_name2id(model, _OBJ.mjOBJ_SITE, name) >= 0 or (
        geom >= 0 and bool(_is_round(model)[geom])
    )


def _find_foot(home: MeasuredModel, foot: str, names: Sequence[str]) -> Foot:
    """Find a foot by the names of its points, or of its body."""
    if named_by_body(home.model, names):
        body = mujoco.mj_name2id(home.model, _OBJ.mjOBJ_BODY, names[0])
        return foot_of_body(home, foot, body)
    points = [_find_point(home, name) for name in names]
    for what, expected, told in (
        ("has points on different bodies", "one body", [home.body_name(p.body) for p in points]),
        ("mixes sites and geoms", "one kind", ["geom" if p.geoms else "site" for p in points]),
        ("has spheres of different radii", "one radius", [f"{p.radius:g} m" for p in points]),
    ):
        if len(set(told)) > 1:
            which = ", ".join(f"{p.name} ({one})" for p, one in zip(points, told, strict=True))
            raise RobotError(f"Foot {foot!r} {what}: {which}. Expected {expected}.")
    places = np.concatenate([p.points for p in points])
    for i, j in itertools.combinations(range(len(points)), 2):
        if np.linalg.norm(places[i] - places[j]) < _DISTINCT:
            raise RobotError(
                f"Foot {foot!r} has points at the same place: {points[i].name}, {points[j].name}. "
                "Expected distinct points."
            )
    geoms = tuple(geom for p in points for geom in p.geoms)
    return Foot(foot, points[0].body, tuple(names), places, points[0].radius, geoms)


def _find_point(home: MeasuredModel, name: str) -> Foot:
    """Find a contact point, as a foot of its own: a site, a sphere, or the end of a capsule.

    A capsule counts by its end farther from the body's origin: the tip of a leg. A site in the
    middle of a sphere that touches means the sphere, or it would be left in the ground; so does one
    that shares its name with a sphere or capsule that touches.
    """
    model = home.model
    site = mujoco.mj_name2id(model, _OBJ.mjOBJ_SITE, name)
    geom = mujoco.mj_name2id(model, _OBJ.mjOBJ_GEOM, name)
    if site < 0 and geom < 0:
        raise RobotError(
            f"No site or geom {name!r}. Valid choices: {listed(_point_names(model))}. A foot can "
            f"also be named by its body: {listed(_body_names(home))}."
        )
    geoms: tuple[int, ...] = ()
    if site >= 0 and not (geom >= 0 and _is_round(model)[geom] and home.touching[geom]):
        body, position = int(model.site_bodyid[site]), model.site_pos[site].copy()
        radius = _radius_about(home, body, position)
    else:
        body, geoms = int(model.geom_bodyid[geom]), (geom,)
        position, radius = model.geom_pos[geom].copy(), float(model.geom_size[geom, 0])
        if model.geom_type[geom] == _GEOM.mjGEOM_CAPSULE:
            half = np.array([0.0, 0.0, model.geom_size[geom, 1]])
            mujoco.mju_rotVecQuat(half, half.copy(), model.geom_quat[geom])
            position = max(position + half, position - half, key=lambda p: float(p @ p))
        elif model.geom_type[geom] != _GEOM.mjGEOM_SPHERE:
            shape = _GEOM(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
            raise RobotError(
                f"Geom {name!r} is a {shape}, which has no single contact point. Name sites at its "
                f"corners instead, or its body, or one of: {listed(_point_names(model))}."
            )
    if model.body_weldid[body] == 0:
        raise RobotError(
            f"Contact point {name!r} is fixed to the world. Valid choices: "
            f"{listed(_point_names(model))}."
        )
    return Foot(name, body, (name,), position[None], radius, geoms)


def _is_round(model: mujoco.MjModel) -> np.ndarray:
    """(ngeom,) bool, spheres and capsules."""
    return np.isin(model.geom_type, (int(_GEOM.mjGEOM_SPHERE), int(_GEOM.mjGEOM_CAPSULE)))


def _point_names(model: mujoco.MjModel) -> list[str]:
    """Names that can serve as contact points: the robot's sites, sphere and capsule geoms."""
    moves = model.body_weldid != 0
    geoms = np.flatnonzero(moves[model.geom_bodyid] & _is_round(model))
    names = {model.site(int(i)).name for i in np.flatnonzero(moves[model.site_bodyid])}
    return sorted((names | {model.geom(int(i)).name for i in geoms}) - {""})


def _body_names(home: MeasuredModel) -> list[str]:
    """Names of the robot's bodies that have something to touch the ground with."""
    bodies = np.unique(home.model.geom_bodyid[home.touching])
    moving = bodies[home.model.body_weldid[bodies] != 0]
    return [*filter(None, (home.model.body(int(body)).name for body in moving))]


def _radius_about(home: MeasuredModel, body: int, place: np.ndarray) -> float:
    """Radius (m) of the sphere on a body whose middle is at a place (3,); 0 if there is none."""
    model = home.model
    touching = (model.geom_bodyid == body) & home.touching
    for geom in np.flatnonzero(touching & (model.geom_type == _GEOM.mjGEOM_SPHERE)):
        radius = float(model.geom_size[geom, 0])
        if np.linalg.norm(model.geom_pos[geom] - place) < _MIDDLE * radius:
            return radius
    return 0.0


def _expect_distinct(what: str, plural: str, names: Sequence[str]) -> None:
    twice = [name for i, name in enumerate(names) if name in names[:i]]
    if twice:
        raise RobotError(f"{what} {twice[0]!r} is given twice. Expected distinct {plural}.")
