"""Pictures of one robot of a batch, by MuJoCo's own renderer and viewer."""

import os
import sys
from collections.abc import Sequence

import mujoco
import mujoco.viewer
import numpy as np

from fbid_gym.checks import check_choices
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.insight import insight
from fbid_gym.envs.overlays import Mark, RenderOptions, marks, size_of
from fbid_gym.errors import FbidError, InvalidValueError
from fbid_gym.options import options_of
from fbid_gym.robots import Robot
from fbid_gym.robots.geoms import Colour, add_arrow, add_ball, add_thread, offscreen
from fbid_gym.runtime.config import Drawing

_ARROW_COLOUR = (0.9, 0.25, 0.1, 1.0)
DISTANCE = 2.5  # of the camera, in the robot's size
# Shares of that size: the arrow of a push of the robot's weight, its width, and how far from the
# base's centre it ends, so that the trunk does not hide it.
_ARROW_LENGTH, _ARROW_WIDTH, _ARROW_GAP = 1.0, 0.0225, 0.4
_SEEN_THROUGH = 0.3  # opacity of the robot
_PIXELS = 230.0  # in the size of the robot, where it is


class RobotRenderer:
    """Draws environments of one kind, unless told otherwise from a camera that follows the base.

    An arrow is a push. Nothing that is drawn changes a robot.
    """

    def __init__(self, drawing: Drawing, robot: Robot) -> None:
        """Check options and camera; the window or the context appears with the first picture."""
        asked = drawing.render_options or {}
        check_choices("render option", asked, options_of(RenderOptions))
        self.shown = RenderOptions(**asked)
        self.mode, self._drawing = drawing.render_mode, drawing
        self._fixed = _camera(drawing, robot.model)
        self._size = 0.0  # m, of the robot, once there is one to draw
        self._renderer: mujoco.Renderer | None = None
        self._viewer: mujoco.viewer.Handle | None = None

    def check_display(self) -> None:
        """Raise FbidError where there shall be a window and cannot."""
        shown = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
        if self.mode == "human" and sys.platform == "linux" and not shown:
            raise FbidError("render_mode 'human' needs a display. Use 'rgb_array' instead.")

    def frames(self, batches: Sequence[EnvBatch]) -> list[np.ndarray]:
        """Draw all environments of some batches, see `render`."""
        drawn = (self.render(batch, env) for batch in batches for env in range(batch.num_envs))
        return [frame for frame in drawn if frame is not None]

    def render(self, batch: EnvBatch, env: int) -> np.ndarray | None:
        """Draw environment `env` of a batch: (H, W, 3) uint8, or None where it is in a window."""
        if self._size == 0.0:
            self._begin(batch)
        self._batch, simulation = batch, batch.simulation
        self._data.qpos[:], self._data.qvel[:] = simulation.qpos[env], simulation.qvel[env]
        mujoco.mj_forward(self._model, self._data)
        if self.mode == "human":
            self._show(env)
            return None
        return self._frame(env)

    def _begin(self, batch: EnvBatch) -> None:
        _, self._model = batch.config.ground(batch.robot)  # with what is only drawn
        self._model.vis.map.alpha = _SEEN_THROUGH
        self._data, self._option = mujoco.MjData(self._model), mujoco.MjvOption()
        self._option.flags[mujoco.mjtVisFlag.mjVIS_TRANSPARENT] = self.shown.any
        self._size = size_of(batch.task.body.stance)
        shape = self._drawing.height, self._drawing.width
        buffer = self._model.vis.global_
        buffer.offheight, buffer.offwidth = np.maximum(shape, (buffer.offheight, buffer.offwidth))

    def _frame(self, env: int) -> np.ndarray:
        if self._renderer is None:
            self._renderer = offscreen(self._model, self._drawing.height, self._drawing.width)
            self._camera = mujoco.MjvCamera()
            self._aim(self._camera)
        self._renderer.update_scene(self._data, self._camera, self._option)
        self._add_to(self._renderer.scene, env)
        return self._renderer.render()

    def _show(self, env: int) -> None:
        if self._viewer is None:
            self.check_display()
            self._viewer = mujoco.viewer.launch_passive(
                self._model, self._data, show_left_ui=False, show_right_ui=False
            )
            self._aim(self._viewer.cam)
            self._viewer.opt.flags[:] = self._option.flags
        with self._viewer.lock():
            self._viewer.user_scn.ngeom = 0
            self._add_to(self._viewer.user_scn, env)
        self._viewer.sync()

    def _aim(self, camera: mujoco.MjvCamera) -> None:
        if self._fixed >= 0:
            camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, self._fixed
            return
        camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
        camera.trackbodyid = self._batch.robot.base_body
        aim = {"distance": DISTANCE * self._size, "azimuth": 140.0, "elevation": -12.0}
        for name, value in (aim | (self._drawing.default_camera_config or {})).items():
            setattr(camera, name, value)

    def _add_to(self, scene: mujoco.MjvScene, env: int) -> None:
        """Add what the model does not hold: a push, and what shall be seen beside."""
        robot = self._batch.robot
        force = self._batch.simulation.batch.xfrc_applied[env, robot.base_body, :3]
        add_push(scene, self._data.xipos[robot.base_body], force / robot.weight, self._size)
        if self.shown.any:
            seen = insight(self._batch, env)
            for mark in marks(self.shown, seen, self._size, robot.weight):
                _add(scene, mark, _PIXELS / self._size)

    def close(self) -> None:
        """Free the window and the context."""
        for shown in (self._renderer, self._viewer):
            if shown is not None:
                shown.close()
        self._renderer = self._viewer = None


def add_push(scene: mujoco.MjvScene, centre: np.ndarray, force: np.ndarray, size: float) -> None:
    """Add an arrow to a scene that ends at the centre (3,) m of a base, if that is pushed.

    The force (3,) is in shares of the robot's weight, the robot's size in m.
    """
    strength = float(np.linalg.norm(force))
    if strength > 0.0:
        end = centre - force / strength * _ARROW_GAP * size
        start = end - force * _ARROW_LENGTH * size
        add_arrow(scene, start, end, _ARROW_WIDTH * size, _ARROW_COLOUR)


def _add(scene: mujoco.MjvScene, mark: Mark, pixels: float) -> None:
    """Add a mark to a scene in which a metre is so many pixels."""
    red, green, blue = (part / 255 for part in mark.colour)
    colour: Colour = (red, green, blue, 1.0)
    if mark.shape == "ball" and np.isfinite(mark.place).all():
        add_ball(scene, mark.place, mark.radius, colour)
    for start, end in mark.place + mark.ends:
        if mark.shape == "arrows":
            add_arrow(scene, start, end, mark.radius, colour)
        else:
            add_thread(scene, start, end, 2.0 * pixels * mark.radius, colour)


def _camera(drawing: Drawing, model: mujoco.MjModel) -> int:
    """The camera of the robot's that is asked for; -1 for the one that follows."""
    names = [model.camera(k).name for k in range(model.ncam)]
    if drawing.camera_name is not None:
        check_choices("camera_name", [drawing.camera_name], names)
        return names.index(drawing.camera_name)
    if drawing.camera_id is not None and drawing.camera_id >= model.ncam:
        expected = f"one of the robot's cameras, of which there are {model.ncam}"
        raise InvalidValueError("camera_id", drawing.camera_id, expected)
    return -1 if drawing.camera_id is None else drawing.camera_id
