"""Pictures, clips and charts of logged motions; pushes are drawn as arrows."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from markupsafe import Markup
from PIL import Image, ImageDraw

from eval.page.figures import Series, panel
from eval.papers.log import Log
from eval.video import encoded, label
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.overlays import size_of
from fbid_gym.envs.rendering import DISTANCE, add_push
from fbid_gym.robots import Robot
from fbid_gym.robots.geoms import offscreen


@dataclass(frozen=True, eq=False)
class Camera:
    """Draws states of one robot, from a point that follows its base."""

    robot: Robot  # what to draw
    width: int = 224  # of the pictures, pixels
    height: int = 300  # of the pictures, pixels
    azimuth: float = 140.0  # degrees
    elevation: float = -12.0  # degrees
    model: mujoco.MjModel | None = None  # the world to draw it in; None for the robot's own
    nearer: float = 1.25  # how many times nearer than usual

    def draw(self, states: Iterable[tuple[np.ndarray, np.ndarray, str]]) -> list[np.ndarray]:
        """Draw states: (nq,), the push (3,) N on the base, and what is written in the corner.

        Returns:
            (H, W, 3) uint8 each.

        Raises:
            FbidError: there is nothing to render with.
        """
        model, pictures = self.model or self.robot.model, []
        data, size = mujoco.MjData(model), size_of(Stance.of(self.robot)) / self.nearer
        camera = mujoco.MjvCamera()
        camera.azimuth, camera.elevation = self.azimuth, self.elevation
        camera.distance = DISTANCE * size
        with offscreen(model, self.height, self.width) as renderer:
            for qpos, push, told in states:
                data.qpos[:] = qpos
                mujoco.mj_kinematics(model, data)
                mujoco.mj_comPos(model, data)
                mujoco.mj_camlight(model, data)
                # Followed at a constant height, so that squats and hops are seen.
                camera.lookat[:] = *qpos[:2], 0.62 * self.robot.home_qpos[2]
                renderer.update_scene(data, camera)
                centre = data.xipos[self.robot.base_body]
                add_push(renderer.scene, centre, push / self.robot.weight, size)
                picture = renderer.render()
                if told:
                    image = Image.fromarray(picture)
                    label(ImageDraw.Draw(image, "RGBA"), (8, 8), told, (20, 24, 32, 170), 15)
                    picture = np.asarray(image)
                pictures.append(picture)
        return pictures

    def strip(
        self, log: Log, moments: Sequence[float] | np.ndarray, digits: int = 1
    ) -> list[np.ndarray]:
        """Draw the first robot of a log at moments (K,) s, as far as it goes, told with digits."""
        qpos, push = log["qpos"][:, 0], log["push"][:, 0]
        there = log.at([moment for moment in moments if moment <= log.time[-1]])
        return self.draw((qpos[k], push[k], f"{log.time[k]:.{digits}f} s") for k in there)

    def film(self, log: Log, fps: float, seconds: float = np.inf) -> bytes:
        """Draw the motion of the first robot of a log, at `fps` pictures per second: an MP4."""
        moments = np.arange(0.0, min(log.time[-1], seconds), 1.0 / fps)
        rows = log.at(moments)
        qpos, push = log["qpos"][rows, 0], log["push"][rows, 0]
        told = zip(moments.tolist(), np.linalg.norm(push, axis=1).tolist(), strict=True)
        labels = [f"{moment:.1f} s" + f", {force:.0f} N" * (force > 0) for moment, force in told]
        return encoded(self.draw(zip(qpos, push, labels, strict=True)), fps, quality=30)


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
