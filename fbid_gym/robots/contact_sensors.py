"""Contact-force sensors: what each contact point of a foot carries, all of it together."""

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.robots.feet import Foot
from fbid_gym.robots.measured_model import MeasuredModel

_OBJ = mujoco.mjtObj
_PREFIX = "fbid_contact_"
# Shapes touch the ground symmetrically, contacts between two points included: not on the border.
_MIDDLE = 0.5001


class SensorBox(NamedTuple):
    """A box about one contact point, where its contacts lie; body frame."""

    centre: np.ndarray  # (3,) m
    half_size: np.ndarray  # (3,) m
    axes: np.ndarray  # (3, 3) columns along its edges


def add_contact_sensors(
    spec: mujoco.MjSpec,
    home: MeasuredModel,
    bodies: Mapping[int, mujoco.MjsBody],
    feet: Sequence[Foot],
) -> list[str]:
    """Add one sensor per contact point: net contact force on the robot there, world frame, N.

    The points of a foot share out whatever its body touches, and what is welded to it. Where all of
    that are the geoms which the points are named after, each point counts its geom. Else the
    foot's space is cut into cells, and each point counts what lies in its own.

    MuJoCo's contact sensor reports the force that the first matched object exerts on the second, so
    the robot is named second. `home` was compiled before anything was added to the spec, and
    `bodies` are the spec's by their ids there. Returns the sensors' names in the order of points.
    """
    names: list[str] = []
    for foot in feet:
        whole = _whole_foot(home, bodies, foot.body)
        by_geoms = set(home.welded_geoms(foot.body)) == set(foot.geoms or [-1])
        reach = max(2.0 * home.model.stat.extent, _reach(home.model, foot.body))
        for point, cell in zip(foot.point_names, cells(foot.points, reach), strict=True):
            name = f"{_PREFIX}{len(names)}"
            matched = whole
            if by_geoms:
                matched = {"reftype": _OBJ.mjOBJ_GEOM, "refname": point}
            elif foot.num_points > 1:
                quat = np.empty(4)
                mujoco.mju_mat2Quat(quat, np.ascontiguousarray(cell.axes).ravel())
                box = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": cell.half_size, "group": 5}
                bodies[foot.body].add_site(name=name, pos=cell.centre, quat=quat, **box)
                matched = whole | {"objtype": _OBJ.mjOBJ_SITE, "objname": name}
            sensor = spec.add_sensor(name=name, type=mujoco.mjtSensor.mjSENS_CONTACT, **matched)
            # data="force", reduce="netforce", num="1"
            sensor.intprm[:3] = [1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3, 1]
            names.append(name)
    return names


def sensor_columns(model: mujoco.MjModel, names: Sequence[str]) -> np.ndarray:
    """Return where in `sensordata` sensors of forces are: (P, 3)."""
    return np.array([model.sensor_adr[model.sensor(name).id] + np.arange(3) for name in names])


def remove_contact_sensors(spec: mujoco.MjSpec) -> None:
    """Remove what `add_contact_sensors` added, from a robot that was written out and is read."""
    for element in [*spec.sensors, *spec.sites]:
        if element.name.startswith(_PREFIX):
            spec.delete(element)


def cells(points: np.ndarray, far: float) -> list[SensorBox]:
    """Cut space, `far` (m) each way, into one box around each of P distinct points (P, 3).

    Again and again it is cut where the gap between points is widest, square to one of two axes:
    those whose narrowest cut is the widest. For a sole's corners these are its quarters.
    """
    if len(points) == 1:
        return [SensorBox(np.zeros(3), np.full(3, far), np.eye(3))]
    normal = np.linalg.svd(points - points.mean(axis=0))[2][-1]
    tries = []
    for i, j in itertools.combinations(range(len(points)), 2):
        along = points[j] - points[i]
        along = along - normal * (normal @ along)
        if np.linalg.norm(along) > 0.0:
            along /= np.linalg.norm(along)
            axes = np.column_stack([along, np.cross(normal, along), normal])
            tries.append((*_cut(points @ axes, far), axes))
    narrowest = [gap for gap, _, _ in tries]
    _, bounds, axes = tries[int(np.argmax(narrowest))]
    return [
        SensorBox(axes @ (0.5 * (low + high)), 0.5 * (high - low), axes)
        for low, high in zip(bounds[:, 0], bounds[:, 1], strict=True)
    ]


def _cut(points: np.ndarray, far: float) -> tuple[float, np.ndarray]:
    """Return the narrowest gap (m) cut through, and each point's box (P, 2, 3): low and high."""
    bounds = np.tile([np.full(3, -far), np.full(3, far)], (len(points), 1, 1))
    narrowest, open_groups = np.inf, [np.arange(len(points))]
    while open_groups:
        group = open_groups.pop()
        if len(group) == 1:
            continue
        orders = group[np.argsort(points[group, :2], axis=0)].T
        gaps = np.array([np.diff(points[order, axis]) for axis, order in enumerate(orders)])
        axis, first = np.unravel_index(np.argmax(gaps), gaps.shape)
        low, high = orders[axis][: first + 1], orders[axis][first + 1 :]
        border = points[low[-1], axis] + _MIDDLE * gaps[axis, first]
        bounds[low, 1, axis] = bounds[high, 0, axis] = border
        narrowest = min(narrowest, float(gaps[axis, first]))
        open_groups += [low, high]
    return narrowest, bounds


def _whole_foot(
    home: MeasuredModel, bodies: Mapping[int, mujoco.MjsBody], body: int
) -> dict[str, object]:
    """Return the match of a sensor of all contacts of a body, and of those welded to it.

    MuJoCo matches one body, or one with all that hangs from it: the latter where nothing that
    hangs there moves by itself.
    """
    root = int(home.model.body_weldid[body])
    if root in home.limb_ends and np.sum(home.model.body_weldid == root) > 1:
        return {"reftype": _OBJ.mjOBJ_XBODY, "refname": _named(bodies, root)}
    return {"reftype": _OBJ.mjOBJ_BODY, "refname": _named(bodies, body)}


def _reach(model: mujoco.MjModel, body: int) -> float:
    """m, no less than what is farthest from the origin of a body, of it and what is welded to it.

    The file may say of its extent what it likes: that is for pictures.
    """
    welded = np.flatnonzero(model.body_weldid == model.body_weldid[body])
    apart = np.linalg.norm(model.body_pos[welded], axis=1).sum()
    geoms = np.isin(model.geom_bodyid, welded)
    far = np.linalg.norm(model.geom_pos[geoms], axis=1) + model.geom_rbound[geoms]
    return float(apart + far.max(initial=0.0))


def _named(bodies: Mapping[int, mujoco.MjsBody], body: int) -> str:
    if not bodies[body].name:
        bodies[body].name = f"fbid_foot_body_{body}"  # its own id is gone once something is added
    return str(bodies[body].name)
