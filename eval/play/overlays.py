"""Inputs and decisions of a layer, drawn over a robot in the browser."""

import numpy as np
import viser

from fbid_gym.envs.insight import Insight
from fbid_gym.envs.overlays import Mark, RenderOptions, marks


class Overlays:
    """The overlays of one robot."""

    def __init__(self, server: viser.ViserServer, root: str, size: float, weight: float) -> None:
        """Send nothing yet. The robot's node is `root`; its size is in m, its weight in N."""
        self._scene, self._root = server.scene, f"{root}/overlays"
        self._size, self._weight = size, weight
        # Goes along with the robot: a browser that is late is late for both.
        self._frame = server.scene.add_frame(self._root, show_axes=False)
        self._nodes: dict[str, viser.SceneNodeHandle] = {}

    def draw(self, shown: RenderOptions, seen: Insight) -> None:
        """Draw what is shown, and hide the rest."""
        self._frame.position = seen.com
        drawn = {
            mark.name: mark
            for mark in marks(shown, seen, self._size, self._weight)
            if np.isfinite(mark.place - seen.com).all() and (mark.shape == "ball" or len(mark.ends))
        }
        for mark in drawn.values():
            self._put(mark, mark.place - seen.com)
        for name, node in self._nodes.items():
            if name not in drawn:
                _show(node, False)

    def hide(self) -> None:
        """Draw none."""
        for node in self._nodes.values():
            _show(node, False)

    def _put(self, mark: Mark, place: np.ndarray) -> None:
        node = self._nodes.get(mark.name)
        if node is None:
            node = self._nodes[mark.name] = self._added(mark)
        elif isinstance(node, viser.ArrowsHandle | viser.LineSegmentsHandle):
            node.points = mark.ends.astype(np.float32)
        node.position = place
        _show(node, True)

    def _added(self, mark: Mark) -> viser.SceneNodeHandle:
        name, colour, radius = f"{self._root}/{mark.name}", mark.colour, mark.radius
        if mark.shape == "ball":
            return self._scene.add_icosphere(name, radius, colour, cast_shadow=False)
        if mark.shape == "lines":
            return self._scene.add_line_segments(name, mark.ends, colour, thickness=2.0 * radius)
        return self._scene.add_arrows(
            name,
            mark.ends,
            colour,
            shaft_radius=radius,
            head_radius=2.5 * radius,
            head_length=6.0 * radius,
        )


def _show(node: viser.SceneNodeHandle, visible: bool) -> None:
    if node.visible != visible:
        node.visible = visible
