"""Pictures of one robot of a batch, by MuJoCo's own renderer and viewer."""

import os
import sys

import mujoco
import mujoco.viewer
import numpy as np

from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.errors import FbidError, UnknownOptionError

RENDER_MODES = ("human", "rgb_array")
WIDTH, HEIGHT = 640, 480

_ARROW_COLOUR = np.array([0.9, 0.25, 0.1, 1.0], np.float32)
# Shares of the camera's distance: the arrow of a push of the robot's weight, its width, and how far
# from the base's centre it ends, so that the trunk does not hide it.
_ARROW_LENGTH, _ARROW_WIDTH, _ARROW_GAP = 0.7, 0.009, 0.08


class RobotRenderer:
    """Draws an environment of a batch from a camera that follows the base; an arrow is a push."""

    def __init__(self, batch: EnvBatch, mode: str) -> None:
        """Open nothing yet: the window or the context appears with the first picture."""
        self._batch, self._mode = batch, mode
        _, self._model = batch.config.ground(batch.robot)  # with what is only drawn
        self._data = mujoco.MjData(self._model)
        stance = batch.task.body.stance
        self._distance = 2.3 * stance.home_base[2] + 3.5 * stance.radius
        self._renderer: mujoco.Renderer | None = None
        self._viewer: mujoco.viewer.Handle | None = None

    def render(self, env: int) -> np.ndarray | None:
        """Draw environment `env`: (H, W, 3) uint8 for "rgb_array", None for "human"."""
        simulation = self._batch.simulation
        self._data.qpos[:], self._data.qvel[:] = simulation.qpos[env], simulation.qvel[env]
        mujoco.mj_forward(self._model, self._data)
        force = simulation.batch.xfrc_applied[env, self._batch.robot.base_body, :3]
        if self._mode == "human":
            self._show(force)
            return None
        return self._frame(force)

    def _frame(self, force: np.ndarray) -> np.ndarray:
        if self._renderer is None:
            try:
                self._renderer = mujoco.Renderer(self._model, height=HEIGHT, width=WIDTH)
            except Exception as error:  # the GL back ends raise types of their own
                raise FbidError(
                    f"Cannot render without a display: {error}. "
                    "Set MUJOCO_GL to 'egl' or 'osmesa' and install its library."
                ) from error
            self._camera = mujoco.MjvCamera()
            self._aim(self._camera)
        self._renderer.update_scene(self._data, self._camera)
        self._draw_push(self._renderer.scene, force)
        return self._renderer.render()

    def _show(self, force: np.ndarray) -> None:
        if self._viewer is None:
            if sys.platform == "linux" and not (
                os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
            ):
                raise FbidError("render_mode 'human' needs a display. Use 'rgb_array' instead.")
            self._viewer = mujoco.viewer.launch_passive(
                self._model, self._data, show_left_ui=False, show_right_ui=False
            )
            self._aim(self._viewer.cam)
        with self._viewer.lock():
            self._viewer.user_scn.ngeom = 0
            self._draw_push(self._viewer.user_scn, force)
        self._viewer.sync()

    def _aim(self, camera: mujoco.MjvCamera) -> None:
        camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        camera.trackbodyid = self._batch.robot.base_body
        camera.distance = self._distance
        camera.azimuth, camera.elevation = 140.0, -12.0

    def _draw_push(self, scene: mujoco.MjvScene, force: np.ndarray) -> None:
        """Add an arrow that ends at the base to the scene, if the base is pushed."""
        size = float(np.linalg.norm(force))
        if size == 0.0 or scene.ngeom >= scene.maxgeom:
            return
        distance, weight = self._distance, self._batch.robot.weight
        centre = self._data.xipos[self._batch.robot.base_body]
        end = centre - force / size * _ARROW_GAP * distance
        start = end - force / weight * _ARROW_LENGTH * distance
        arrow = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(
            arrow, mujoco.mjtGeom.mjGEOM_ARROW, np.zeros(3), np.zeros(3), np.zeros(9), _ARROW_COLOUR
        )
        mujoco.mjv_connector(
            arrow, mujoco.mjtGeom.mjGEOM_ARROW, _ARROW_WIDTH * distance, start, end
        )
        scene.ngeom += 1

    def close(self) -> None:
        """Free the window and the context."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None


def check_render_mode(mode: str | None) -> None:
    """Raise an error unless `mode` is a render mode or None."""
    if mode is not None and not (isinstance(mode, str) and mode in RENDER_MODES):
        raise UnknownOptionError("render_mode", mode, (*RENDER_MODES, "None"))
