"""Meshes as they compile, written again: of specs that were put together from several folders."""

import mujoco
import numpy as np


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
