"""Pictures and clips of logged motions, pushes drawn as arrows."""

from collections.abc import Sequence
from types import TracebackType

import mujoco
import numpy as np
from markupsafe import Markup
from PIL import Image, ImageDraw, ImageFont

from eval.page.figures import Series, panel
from eval.page.html import frames, video
from eval.papers.log import Log
from eval.video import Clip
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.overlays import size_of
from fbid_gym.envs.rendering import DISTANCE, add_push
from fbid_gym.robots import Robot
from fbid_gym.robots.geoms import offscreen


class Camera:
    """Draws states of one robot, from a point that follows its base. A context manager."""

    def __init__(
        self,
        robot: Robot,
        width: int = 320,
        height: int = 320,
        azimuth: float = 140.0,
        elevation: float = -12.0,
        model: mujoco.MjModel | None = None,
        nearer: float = 1.0,
    ) -> None:
        """Open the off-screen renderer.

        Args:
            robot: what to draw.
            width: of the pictures, pixels.
            height: of the pictures, pixels.
            azimuth: degrees.
            elevation: degrees.
            model: the world to draw it in; None for the robot's own.
            nearer: how many times nearer than usual.

        Raises:
            FbidError: there is nothing to render with.
        """
        self._robot, self._model = robot, robot.model if model is None else model
        self._data = mujoco.MjData(self._model)
        self._size = size_of(Stance.of(robot)) / nearer
        self._renderer = offscreen(self._model, height, width)
        self._camera = mujoco.MjvCamera()
        self._camera.azimuth, self._camera.elevation = azimuth, elevation
        self._camera.distance = DISTANCE * self._size

    def __enter__(self) -> "Camera":
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Free the renderer."""
        self._renderer.close()

    def picture(self, qpos: np.ndarray, push: np.ndarray, label: str = "") -> np.ndarray:
        """Draw one state.

        Args:
            qpos: (nq,).
            push: (3,) N on the base.
            label: written into the upper left corner.

        Returns:
            (H, W, 3) uint8.
        """
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        # Followed at a constant height, so that squats and hops are seen.
        self._camera.lookat[:2] = qpos[:2]
        self._camera.lookat[2] = 0.62 * self._robot.home_qpos[2]
        self._renderer.update_scene(self._data, self._camera)
        centre = self._data.xipos[self._robot.base_body]
        add_push(self._renderer.scene, centre, push / self._robot.weight, self._size)
        image = self._renderer.render()
        return _labelled(image, label) if label else image

    def strip(
        self,
        log: Log,
        moments: Sequence[float] | np.ndarray,
        caption: str,
        of: str,
        digits: int = 1,
    ) -> Markup:
        """Draw the first robot of a log at some moments (K,) s, side by side, as a figure.

        Args:
            log: of the robot.
            moments: when; the last tick stands for what is beyond it.
            caption: HTML.
            of: plain text for those who do not see the pictures.
            digits: of the seconds on the pictures.
        """
        images = [
            self.picture(log["qpos"][k, 0], log["push"][k, 0], f"{log.time[k]:.{digits}f} s")
            for k in log.at(moments)
        ]
        return frames(images, caption, of)

    def film(self, log: Log, fps: float, caption: str, seconds: float = np.inf) -> Markup:
        """Draw the motion of the first robot of a log, at `fps` pictures per second, as a video."""
        moments = np.arange(0.0, min(log.time[-1], seconds), 1.0 / fps)
        rows, pictures = log.at(moments), []
        push = log["push"][rows, 0]
        for moment, row, newtons in zip(moments, rows, push, strict=True):
            force = float(np.linalg.norm(newtons))
            pushed = f", {force:.0f} N" if force > 0 else ""
            pictures.append(self.picture(log["qpos"][row, 0], newtons, f"{moment:.1f} s{pushed}"))
        return video(Clip(pictures, fps, push, None).mp4(30), caption)


def _labelled(picture: np.ndarray, label: str) -> np.ndarray:
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image, "RGBA")
    font = ImageFont.load_default(15)
    width = draw.textlength(label, font=font)
    draw.rounded_rectangle((8, 8, 20 + width, 31), radius=5, fill=(20, 24, 32, 170))
    draw.text((14, 19), label, font=font, fill=(255, 255, 255, 255), anchor="lm")
    return np.asarray(image)


def logged(
    curves: Sequence[tuple[str, int, Log, np.ndarray]],
    title: str,
    since: float = -np.inf,
    until: float = np.inf,
) -> Markup:
    """Draw curves over time of the first robots of logs, each up to its robot's fall.

    Args:
        curves: (name, colour, log, (T,) values at the log's ticks) each.
        title: what is shown, with its unit.
        since: s, where the chart begins.
        until: s, where it ends.
    """
    series = []
    for name, colour, log, values in curves:
        shown = log.up[:, 0] & (log.time > since) & (log.time < until)
        if shown.any():
            series.append(Series(name, colour, log.time[shown], values[shown]))
    longest = max((log.time for _, _, log, _ in curves), key=len)
    inside = longest[(longest > since) & (longest < until)]
    return panel(series, title, "s", x_range=(float(inside[0]), float(inside[-1])))
