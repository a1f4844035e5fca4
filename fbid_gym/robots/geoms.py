"""MuJoCo's renderer, and shapes that it draws beside a model: a full scene gets none of them."""

import mujoco
import numpy as np

from fbid_gym.errors import FbidError

_GEOM = mujoco.mjtGeom

Colour = tuple[float, float, float, float]
"""Red, green, blue, opacity, each from 0 to 1."""


def offscreen(model: mujoco.MjModel, height: int, width: int) -> mujoco.Renderer:
    """Return a renderer of pictures of this size in pixels.

    Raises:
        FbidError: nothing to draw with.
    """
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


def add_line(
    scene: mujoco.MjvScene, start: np.ndarray, end: np.ndarray, radius: float, colour: Colour
) -> None:
    """Add a line from a place (3,) m to another."""
    _connect(scene, _GEOM.mjGEOM_CAPSULE, start, end, radius, colour)


def add_thread(
    scene: mujoco.MjvScene, start: np.ndarray, end: np.ndarray, width: float, colour: Colour
) -> None:
    """Add a line as wide, in pixels, wherever it is; it casts no shadow."""
    _connect(scene, _GEOM.mjGEOM_LINE, start, end, width, colour)


def add_arrow(
    scene: mujoco.MjvScene, start: np.ndarray, end: np.ndarray, radius: float, colour: Colour
) -> None:
    """Add an arrow from a place (3,) m to another; its head is a few radii long."""
    geom = _connect(scene, _GEOM.mjGEOM_ARROW, start, end, radius, colour)
    if geom is not None:
        geom.size[2] *= 2.0  # of an arrow half of it is drawn


def _connect(
    scene: mujoco.MjvScene,
    kind: mujoco.mjtGeom,
    start: np.ndarray,
    end: np.ndarray,
    width: float,
    colour: Colour,
) -> mujoco.MjvGeom | None:
    geom = _next(scene, kind, colour)
    if geom is not None:
        mujoco.mjv_connector(geom, kind, width, start, end)
    return geom


def _next(scene: mujoco.MjvScene, kind: mujoco.mjtGeom, colour: Colour) -> mujoco.MjvGeom | None:
    """The next geom of a scene, at its origin; None where it is full."""
    if scene.ngeom >= scene.maxgeom:
        return None
    geom, nowhere, axes = scene.geoms[scene.ngeom], np.zeros(3), np.eye(3).ravel()
    mujoco.mjv_initGeom(geom, kind, nowhere, nowhere, axes, np.array(colour, np.float32))
    scene.ngeom += 1
    return geom
