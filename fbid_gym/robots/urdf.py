"""A URDF as a floating robot: links keep their names, meshes are found or done without."""

from pathlib import Path

import mujoco

from fbid_gym.errors import RobotError
from fbid_gym.robots.mjcf import listed

_READABLE = (".stl", ".obj", ".msh")


def prepare_urdf(spec: mujoco.MjSpec, folder: Path | None) -> list[str]:
    """Make a parsed URDF a robot's MJCF.

    Links on fixed joints stay bodies of their own, so that feet can be named. Meshes are looked for
    in the folders above, as `package://` would; those that cannot be found are dropped if they are
    only drawn.

    Args:
        spec: the spec to change.
        folder: where the URDF lies; None for a text.

    Returns:
        Notes of what was changed.

    Raises:
        RobotError: a mesh that collides cannot be found.
    """
    spec.compiler.fusestatic = False
    dropped = []
    for mesh in list(spec.meshes):
        if not mesh.file:
            continue
        path = _find(mesh.file, spec.meshdir, folder)
        if path is not None:
            mesh.file = str(path)
            continue
        used = [geom for geom in spec.geoms if geom.meshname == mesh.name]
        colliding = [geom.parent.name for geom in used if geom.contype or geom.conaffinity]
        if colliding:
            raise RobotError(
                f"Mesh {mesh.file!r} of the links {listed(colliding)}, which they collide with, is "
                f"not found, or not one of {', '.join(_READABLE)}."
            )
        for geom in used:
            spec.delete(geom)
        dropped.append(mesh.name)
        spec.delete(mesh)
    return [f"{len(dropped)} meshes dropped, which were not found and only drawn."] * bool(dropped)


def root_link(spec: mujoco.MjSpec) -> str | None:
    """Name of the one top-level body, if it does not move yet."""
    top = list(spec.worldbody.bodies)
    return top[0].name if len(top) == 1 and not list(top[0].joints) else None


def _find(file: str, meshdir: str, folder: Path | None) -> Path | None:
    """Path of a mesh that MuJoCo can read."""
    if Path(file).suffix.lower() not in _READABLE:
        return None
    inside = Path(file.split("://", 1)[-1])
    around = [Path.cwd()] if folder is None else [folder / meshdir, folder, *folder.parents]
    # package://name/rest: the package's folder may be called otherwise.
    tries = [inside, Path(*inside.parts[1:])] if "://" in file else [inside]
    paths = (place / part for place in around for part in tries)
    return next((path for path in paths if path.is_file()), None)
