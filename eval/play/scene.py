"""The robots of a session in the browser; the ground moves under them, so the camera is free."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import viser

from eval.play.lane import Lane
from eval.play.shapes import Shape, shapes
from eval.play.view import aim, show_from
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.overlays import size_of

_BELIEVED = np.array([120, 40, 200])  # of the base where the robot takes it to be
_SECOND = np.array([40, 120, 255])  # what the second robot's colours are mixed with
_PUSH_COLOUR = (230, 64, 26)
_GRID = 40.0  # m
# Shares of the robot's size, see `Scene.size`: the arrow of a push of its weight, and its gap.
_ARROW_LENGTH, _ARROW_GAP = 0.7, 0.1

Drag = Callable[[np.ndarray, bool], None]
"""Called with how far (3,) m, world, the pointer is from where it took hold, and whether it let
go."""


class DrawnRobot:
    """The frames of one robot's bodies."""

    def __init__(
        self, server: viser.ViserServer, lane: Lane, place: int, offset: np.ndarray, drag: Drag
    ) -> None:
        """Send the shapes."""
        batch = lane.batch
        _, self._model = batch.config.ground(batch.config.load_robot())  # with what is only drawn
        self._data = mujoco.MjData(self._model)
        # The node that all of it hangs from, and (3,) m, where its world lies in the scene.
        self.root, self.offset, self._place = f"/world/robot{place}", offset, place
        self.node = server.scene.add_frame(self.root, show_axes=False, position=offset)
        drawn = list(shapes(self._model))
        tint = 0.5 if place else 0.0
        self._moving = sorted({shape.body for shape in drawn} - {0})
        self._frames = {
            body: server.scene.add_frame(f"{self.root}/body{body}", show_axes=False)
            for body in self._moving
        }
        for number, shape in enumerate(drawn):
            if shape.body or place == 0 or offset.any():
                self._send(server, shape, f"{self.root}/body{shape.body}/{number}", tint, drag)
        self._trunk = batch.robot.base_body
        if lane.believed is not None:
            self._haunt(server, [shape for shape in drawn if shape.body == self._trunk])
        self._arrow = server.scene.add_arrows(
            f"{self.root}/push", np.zeros((1, 2, 3)), _PUSH_COLOUR, visible=False
        )
        self._label = server.scene.add_label(f"{self.root}/label", "", visible=False)
        self._before = self._now = self._poses(lane)

    def _send(
        self, server: viser.ViserServer, shape: Shape, name: str, tint: float, drag: Drag
    ) -> None:
        share = tint if shape.body else 0.0
        colour = ((1.0 - share) * np.array(shape.colour) + share * _SECOND).astype(int)
        mesh = server.scene.add_mesh_simple(
            name,
            shape.vertices,
            shape.faces,
            color=tuple(colour.tolist()),
            opacity=shape.opacity if shape.opacity < 1.0 else None,
            flat_shading=not shape.body,
            cast_shadow=bool(shape.body),
        )
        if shape.body:

            @mesh.on_drag("left")
            def _(event: viser.SceneNodeDragEvent) -> None:
                moved = np.subtract(event.end_position, event.start_position)
                drag(moved, event.phase == "end")

    def _haunt(self, server: viser.ViserServer, trunk: list[Shape]) -> None:
        """Send a ghost of the base, for where the robot takes it to be; it is drawn last."""
        root = f"{self.root}/believed"
        self._frames[-1] = server.scene.add_frame(root, show_axes=False)
        for number, shape in enumerate(trunk):
            server.scene.add_mesh_simple(
                f"{root}/{number}",
                shape.vertices,
                shape.faces,
                color=tuple(_BELIEVED.tolist()),
                opacity=0.4,
                cast_shadow=False,
            )

    def _poses(self, lane: Lane) -> np.ndarray:
        """(B, 7) place and quaternion of each body that is drawn, and of the believed base."""
        self._data.qpos[:] = lane.qpos
        mujoco.mj_kinematics(self._model, self._data)
        bodies = self._moving
        found = np.concatenate([self._data.xpos[bodies], self._data.xquat[bodies]], axis=1)
        return found if lane.believed is None else np.vstack([found, lane.believed])

    def look(self, lane: Lane) -> None:
        """Take the pose after a policy step."""
        self._before, self._now = self._now, self._poses(lane)
        if np.linalg.norm(self._now[0, :3] - self._before[0, :3]) > 0.5:  # put somewhere else
            self._before = self._now

    def trunk(self, share: float) -> np.ndarray:
        """(3,) m, where the base is in its own world."""
        return self._between(share)[self._moving.index(self._trunk), :3]

    def draw(self, share: float, push: np.ndarray, size: float, weight: float, word: str) -> None:
        """Move all bodies to where they are this share of a policy step after the last but one."""
        for frame, pose in zip(self._frames.values(), self._between(share), strict=True):
            frame.position, frame.wxyz = pose[:3], pose[3:]
        trunk, force = self.trunk(share), float(np.linalg.norm(push))
        if force:
            end = trunk - push / force * _ARROW_GAP * size
            start = end - push / weight * _ARROW_LENGTH * size
            self._arrow.points = np.array([[start, end]], np.float32)
            thick = 0.02 * size
            self._arrow.shaft_radius, self._arrow.head_radius = thick, 2.5 * thick
            self._arrow.head_length = min(5.0 * thick, 0.5 * float(np.linalg.norm(end - start)))
        if self._arrow.visible != bool(force):
            self._arrow.visible = bool(force)
        if word != self._label.text:
            self._label.text, self._label.visible = word, bool(word)
        if word:
            # One above the other where robots walk in the same place.
            above = (0.6 + 0.15 * self._place) * size
            self._label.position = trunk + np.array([0.0, 0.0, above])

    def _between(self, share: float) -> np.ndarray:
        before, now = self._before, self._now
        # The shorter way between two orientations.
        sign = np.where(np.vecdot(before[:, 3:], now[:, 3:]) < 0.0, -1.0, 1.0)[:, None]
        pose = (1.0 - share) * before
        pose[:, :3] += share * now[:, :3]
        pose[:, 3:] += share * sign * now[:, 3:]
        pose[:, 3:] /= np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)
        return pose


class Scene:
    """Ground and robots."""

    def __init__(self, server: viser.ViserServer, lanes: list[Lane], drag: Drag) -> None:
        """Send ground and robots, and place the camera of those who come."""
        self._server, self._drag = server, drag
        self._world = server.scene.add_frame("/world", show_axes=False)
        server.scene.set_up_direction("+z")
        self._measured: Stance | None = None

        @server.on_client_connect
        def _(client: viser.ClientHandle) -> None:
            if client.camera.aspect < 1.0:  # the camera of those who come is for a wide picture
                aim(client, self.size, self._height)

        self.bodies: list[DrawnRobot] = []
        self._shown: list[list[Any]] = []
        self.cast(lanes)

    def cast(self, lanes: list[Lane]) -> bool:
        """Show these robots instead of those before; whether they are others."""
        worlds = [lane.batch.config.as_dict() for lane in lanes]
        names = ("robot", "terrain", "difficulty", "sensors")
        shown = [[world[name] for name in names] for world in worlds]
        if shown == self._shown:
            return False
        self._measure(lanes[0].batch.task.body.stance)
        for body in self.bodies:
            body.node.remove()
        level = lanes[0].batch.config.terrain == "flat"
        beside = np.array([0.0, 1.4 * self.size if level else 0.0, 0.0])
        self.bodies = [
            DrawnRobot(self._server, lane, place, place * beside, self._drag)
            for place, lane in enumerate(lanes)
        ]
        self._shown = shown
        return True

    def _measure(self, stance: Stance) -> None:
        """Fit the ground and the first view to a robot, unless it is the one that they fit."""
        if stance is self._measured:
            return
        self._measured, self.size = stance, size_of(stance)  # m, of the robot as it stands
        cell = 0.25 if self.size < 1.0 else 0.5
        self._section = 4.0 * cell
        self._grid = self._server.scene.add_grid(
            "/world/ground",
            _GRID,
            _GRID,
            cell_size=cell,
            section_size=self._section,
            plane_color=(232, 236, 240),
            plane_opacity=1.0,
            shadow_opacity=0.3,
            fade_distance=12.0 * self.size,
        )
        self._height = float(stance.home_base[2])
        show_from(self._server, self.size, self._height)

    def look(self, lanes: list[Lane]) -> None:
        """Take the poses after a policy step."""
        for body, lane in zip(self.bodies, lanes, strict=True):
            body.look(lane)

    def draw(self, lanes: list[Lane], share: float, weight: float) -> None:
        """Draw the robots a share of a policy step after the last but one; the camera follows."""
        centre = np.mean([body.trunk(share) + body.offset for body in self.bodies], axis=0)
        # The floor ends nowhere: it goes along, a whole number of its squares at a time.
        step = np.round(centre[:2] / self._section) * self._section
        if not np.array_equal(self._grid.position[:2], step):
            self._grid.position = (step[0], step[1], -1e-3)
        self._world.position = (-centre[0], -centre[1], 0.0)
        for body, lane in zip(self.bodies, lanes, strict=True):
            word = lane.player.word if len(lanes) > 1 else ""
            body.draw(share, lane.push_force, self.size, weight, word)
