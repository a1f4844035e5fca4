"""MuJoCo's geoms as triangles, merged by body and colour."""

from collections.abc import Iterator
from typing import NamedTuple

import mujoco
import numpy as np
import trimesh

_GEOM = mujoco.mjtGeom
_DRAWN_GROUPS = 3  # as in MuJoCo's own viewer


class Shape(NamedTuple):
    """Shapes of a body that have one colour."""

    body: int
    colour: tuple[int, int, int]  # red, green, blue, 0 to 255
    opacity: float  # 0 to 1
    vertices: np.ndarray  # (V, 3) m, in the body's frame
    faces: np.ndarray  # (T, 3) int


def shapes(model: mujoco.MjModel) -> Iterator[Shape]:
    """Yield all that is drawn of a model but planes, which have no end."""
    parts: dict[tuple[int, bytes], list[trimesh.Trimesh]] = {}
    for geom in range(model.ngeom):
        if model.geom_group[geom] >= _DRAWN_GROUPS:
            continue
        mesh, rgba = _mesh(model, geom), _rgba(model, geom)
        if mesh is None or rgba[3] == 0.0:
            continue
        place = np.eye(4)
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        place[:3, :3], place[:3, 3] = rotation.reshape(3, 3), model.geom_pos[geom]
        mesh.apply_transform(place)
        parts.setdefault((int(model.geom_bodyid[geom]), rgba.tobytes()), []).append(mesh)
    for (body, raw), meshes in parts.items():
        rgba = np.frombuffer(raw, np.float32)
        whole = trimesh.util.concatenate(meshes)
        red, green, blue = (round(255 * float(part)) for part in rgba[:3])
        yield Shape(
            body,
            (red, green, blue),
            float(rgba[3]),
            np.array(whole.vertices, np.float32),
            np.array(whole.faces, np.uint32),
        )


def _rgba(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """A material's colour goes before the geom's own unless that was set, as MuJoCo has it."""
    material, own = model.geom_matid[geom], model.geom_rgba[geom]
    if material >= 0 and np.array_equal(own, np.full(4, 0.5, np.float32) + [0, 0, 0, 0.5]):
        own = model.mat_rgba[material]
    return np.array(own, np.float32)


def _mesh(model: mujoco.MjModel, geom: int) -> trimesh.Trimesh | None:
    """A geom in its own frame; None for what has no triangles."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    if kind == _GEOM.mjGEOM_BOX:
        mesh = trimesh.creation.box(2.0 * size)
        mesh.unmerge_vertices()  # edges are sharp
        return mesh
    if kind == _GEOM.mjGEOM_SPHERE:
        return trimesh.creation.icosphere(2, size[0])
    if kind == _GEOM.mjGEOM_ELLIPSOID:
        mesh = trimesh.creation.icosphere(2, 1.0)
        mesh.apply_scale(size)
        return mesh
    if kind == _GEOM.mjGEOM_CAPSULE:
        return _centred(trimesh.creation.capsule(2.0 * size[1], size[0], count=[12, 16]))
    if kind == _GEOM.mjGEOM_CYLINDER:
        return _centred(trimesh.creation.cylinder(size[0], 2.0 * size[1], sections=24))
    if kind == _GEOM.mjGEOM_MESH:
        return _asset(model, int(model.geom_dataid[geom]))
    if kind == _GEOM.mjGEOM_HFIELD:
        return _height_field(model, int(model.geom_dataid[geom]))
    return None


def _centred(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    return mesh


def _asset(model: mujoco.MjModel, mesh: int) -> trimesh.Trimesh:
    vertex, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    face, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return trimesh.Trimesh(
        model.mesh_vert[vertex : vertex + count].copy(),
        model.mesh_face[face : face + faces].copy(),
        process=False,
    )


def _height_field(model: mujoco.MjModel, field: int) -> trimesh.Trimesh:
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    first = model.hfield_adr[field]
    wide, deep, high, _ = model.hfield_size[field]
    height = high * model.hfield_data[first : first + rows * columns]
    x, y = np.meshgrid(np.linspace(-wide, wide, columns), np.linspace(-deep, deep, rows))
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (
        part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    )
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    vertices = np.stack([x.ravel(), y.ravel(), height], axis=1)
    return trimesh.Trimesh(vertices, faces, process=False)
