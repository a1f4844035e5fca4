"""Meshes of files: found, converted where MuJoCo cannot read them, done without; or written."""

import re
from pathlib import Path

import mujoco
import numpy as np

from fbid_gym.robots.mjcf import listed

_READABLE, _CONVERTED = (".stl", ".obj", ".msh"), (".dae", ".stl")
_MOST_FACES = 200_000  # of an STL, by MuJoCo
_HEAD = 84  # bytes of a binary STL, the last four of them its number of faces; each has 50


def mend_meshes(
    spec: mujoco.MjSpec, folder: Path | None, is_urdf: bool
) -> tuple[list[str], list[str]]:
    """Find a spec's meshes, convert those that MuJoCo cannot read, and drop the others.

    They are looked for in the folders above that of the file, None for a text, as `package://`
    would. Those of a kind that MuJoCo does not read, `.dae` above all, are converted if the package
    trimesh is there. A mesh that a body of an MJCF weighs by stays for MuJoCo to complain of; links
    of a URDF never weigh by what is drawn.

    Returns notes of what was changed, and names of the bodies that lost a mesh they collide with.
    """
    converted, drawn, bare = 0, 0, list[str]()
    for mesh in [mesh for mesh in spec.meshes if mesh.file]:
        inside = Path(mesh.file).name if spec.strippath else mesh.file
        own = Path(folder or Path.cwd(), spec.meshdir, inside)
        path = own if own.is_file() else _find(mesh.file, spec.meshdir, folder)
        if path is not None and is_readable(path):
            mesh.file = str(path) if is_urdf or path != own else mesh.file
            continue
        if path is not None and (shape := _converted(path)) is not None:
            mesh.uservert, mesh.userface = shape[0].ravel(), shape[1].ravel()
            mesh.file, mesh.content_type = "", ""
            converted += 1
            continue
        used = [geom for geom in spec.geoms if geom.meshname == mesh.name]
        if not is_urdf and not all(geom.parent.explicitinertial for geom in used):
            continue
        collided = [geom.parent.name for geom in used if geom.contype or geom.conaffinity]
        bare += collided
        drawn += not collided
        for part in (*used, mesh):
            spec.delete(part)
    notes = [f"{converted} meshes converted, which MuJoCo does not read."] * bool(converted)
    notes += [f"{drawn} meshes dropped, which were not found and only drawn."] * bool(drawn)
    lost = listed(dict.fromkeys(bare))
    notes += [f"Meshes that the bodies {lost} collide with left out: see `load`."] * bool(bare)
    return notes, bare


def is_readable(path: Path) -> bool:
    """Return whether MuJoCo reads a mesh: of an STL binary ones alone, and no larger ones."""
    suffix = path.suffix.lower()
    if suffix != ".stl":
        return suffix in _READABLE
    with path.open("rb") as file:
        faces = int.from_bytes(file.read(_HEAD)[80:], "little")
    return faces <= _MOST_FACES and path.stat().st_size == _HEAD + 50 * faces


def _converted(path: Path) -> tuple[np.ndarray, np.ndarray] | None:
    """Vertices (V, 3) m and faces (F, 3) of a mesh; None without trimesh, or if it cannot."""
    if path.suffix.lower() not in _CONVERTED:  # trimesh reads many more, archives among them
        return None
    try:
        import trimesh

        shape = trimesh.load(path, force="mesh")
        vertices, faces = np.asarray(shape.vertices, float), np.asarray(shape.faces, int)
    except Exception:  # whatever its many readers raise of a stranger's file
        return None
    if path.suffix.lower() == ".dae":
        unit = re.search(rb'<unit\b[^>]*\bmeter="([^"]+)"', path.read_bytes())
        vertices = vertices * float(unit[1] if unit else 1.0)
    return (vertices, faces) if len(faces) else None


def _find(file: str, meshdir: str, folder: Path | None) -> Path | None:
    """Path of a mesh that a file names."""
    inside = Path(file.split("://", 1)[-1])
    around = [Path.cwd()] if folder is None else [folder / meshdir, folder, *folder.parents]
    # package://name/rest: the package's folder may be called otherwise.
    tries = [inside, Path(*inside.parts[1:])] if "://" in file else [inside]
    paths = (place / part for place in around for part in tries)
    return next((path for path in paths if path.is_file()), None)


def as_obj(model: mujoco.MjModel, mesh: int) -> bytes:
    """Return a mesh of a model as an OBJ file: scaled and placed as the file's own MJCF had it."""
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    # MuJoCo keeps the vertices about the centre of mass and along the principal axes.
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.mesh_quat[mesh])
    vertices = model.mesh_vert[first : first + count].astype(float) @ rotation.reshape(3, 3).T
    vertices += model.mesh_pos[mesh]
    first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    faces = model.mesh_face[first : first + count] + 1
    lines = ["v " + " ".join(f"{value:.9g}" for value in vertex) for vertex in vertices]
    lines += ["f " + " ".join(map(str, face)) for face in faces]
    return ("\n".join(lines) + "\n").encode()


def take_over(mesh: mujoco.MjsMesh, file: str) -> None:
    """Let a mesh of a spec be read from what `as_obj` wrote."""
    mesh.file, mesh.content_type = file, ""
    mesh.scale, mesh.refpos, mesh.refquat = [1, 1, 1], [0, 0, 0], [1, 0, 0, 0]
