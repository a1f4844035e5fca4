"""MuJoCo's renderer, and shapes that it draws beside a model: a full scene gets none of them."""

from functools import partial

import mujoco
import numpy as np

from fbid_gym.errors import FbidError

_GEOM = mujoco.mjtGeom

Colour = tuple[float, float, float, float]  # red, green, blue, opacity, each from 0 to 1


def offscreen(model: mujoco.MjModel, height: int, width: int) -> mujoco.Renderer:
    """Return a renderer of pictures of this size in pixels; FbidError: nothing to draw with."""
    try:
        return mujoco.Renderer(model, height=height, width=width)
    except Exception as error:  # the GL back ends raise types of their own
        raise FbidError(
            f"Cannot render without a display: {error}. "
            "Set MUJOCO_GL to 'egl' or 'osmesa' and install its library."
        ) from error


def add_ball(scene: mujoco.MjvScene, place: np.ndarray, radius: float, colour: Colour) -> None:
    """Add a ball at a place (3,) m."""
    geom = _next(scene, _GEOM.mjGEOM_SPHERE, colour)
    if geom is not None:
        geom.pos[:], geom.size[:] = place, radius


def _connect(
    kind: mujoco.mjtGeom,
    scene: mujoco.MjvScene,
    start: np.ndarray,
    end: np.ndarray,
    width: float,
    colour: Colour,
) -> None:
    """Add a shape from a place (3,) m to another; its width is a radius in m, or in pixels."""
    geom = _next(scene, kind, colour)
    if geom is not None:
        mujoco.mjv_connector(geom, kind, width, start, end)
        if kind == _GEOM.mjGEOM_ARROW:
            geom.size[2] *= 2.0  # of an arrow half of it is drawn


add_line = partial(_connect, _GEOM.mjGEOM_CAPSULE)
add_arrow = partial(_connect, _GEOM.mjGEOM_ARROW)  # its head is a few radii long
# As wide, in pixels, wherever it is; it casts no shadow.
add_thread = partial(_connect, _GEOM.mjGEOM_LINE)


def _next(scene: mujoco.MjvScene, kind: mujoco.mjtGeom, colour: Colour) -> mujoco.MjvGeom | None:
    """The next geom of a scene, at its origin; None where it is full."""
    if scene.ngeom >= scene.maxgeom:
        return None
    geom, nowhere, axes = scene.geoms[scene.ngeom], np.zeros(3), np.eye(3).ravel()
    mujoco.mjv_initGeom(geom, kind, nowhere, nowhere, axes, np.array(colour, np.float32))
    scene.ngeom += 1
    return geom
