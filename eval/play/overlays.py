"""What a layer sees and decides, drawn over a robot; each kind can be switched off."""

import numpy as np
import viser

from eval.play.insight import Insight

LABELS = {
    "forces": "contact forces (green: measured, orange: commanded)",
    "cones": "friction cones",
    "com": "centre of mass (white)",
    "capture": "capture point (violet)",
    "support": "support polygon, centre of pressure (yellow)",
    "footholds": "next footholds (blue)",
    "acceleration": "body's acceleration (red: desired, green: achieved)",
}
"""Kind -> what it is, on the page."""
SHOWN_FIRST = ("forces", "com")

_GREEN, _ORANGE, _RED, _YELLOW = (40, 170, 80), (245, 150, 30), (220, 40, 60), (240, 200, 30)
_VIOLET, _BLUE, _WHITE, _GREY = (150, 70, 210), (40, 120, 240), (250, 250, 250), (120, 130, 140)
_CORNERS = 16  # of a cone's rim
_FORCE, _CONE, _ACCELERATION = 1.0, 0.25, 0.08  # sizes: of a weight, of a cone, of a m/s^2


class Overlays:
    """The overlays of one robot."""

    def __init__(self, server: viser.ViserServer, root: str, size: float, weight: float) -> None:
        """Send them, out of sight.

        Args:
            server: of the page.
            root: name of the robot's node.
            size: m, of the robot.
            weight: N.
        """
        self._scene, self._root, self._size, self._weight = server.scene, root, size, weight
        self._balls: dict[str, viser.IcosphereHandle] = {}
        self._lines: dict[str, viser.LineSegmentsHandle] = {}
        self._arrows: dict[str, viser.ArrowsHandle] = {}

    def draw(self, shown: set[str], seen: Insight, achieved: np.ndarray) -> None:
        """Draw the kinds that are shown.

        Args:
            shown: of `LABELS`.
            seen: of the robot.
            achieved: (3,) m/s^2, acceleration of its centre of mass.
        """
        none = np.zeros((0, 2, 3))
        loaded = np.linalg.norm(seen.measured, axis=1) > 0.0
        forces = "forces" in shown
        self._arrow("measured", _from(seen.points, self._long(seen.measured), forces), _GREEN, 1.0)
        asked = _from(seen.points, self._long(seen.commanded), forces)
        self._arrow("commanded", asked, _ORANGE, 0.7)
        cones = self._cones(seen.points[loaded], seen.friction) if "cones" in shown else none
        self._line("cones", cones, _GREY)
        support = "support" in shown and len(seen.support) > 1
        edges = np.stack([seen.support, np.roll(seen.support, -1, axis=0)], axis=1)
        self._line("support", edges if support else none, _YELLOW)
        self._ball("pressure", seen.pressure if support else None, _YELLOW, 0.022)
        self._ball("com", seen.com if "com" in shown else None, _WHITE, 0.03)
        self._ball("capture", seen.capture_point if "capture" in shown else None, _VIOLET, 0.025)
        for place in range(len(seen.points)):
            landing = "footholds" in shown and place < len(seen.footholds)
            spot = seen.footholds[place] if landing else None
            self._ball(f"foothold{place}", spot, _BLUE, 0.025)
        moves = "acceleration" in shown
        scale = _ACCELERATION * self._size
        centre = seen.com[None] + np.array([0.0, 0.0, 0.25 * self._size])
        self._arrow("desired", _from(centre, scale * seen.desired[None], moves), _RED, 0.7)
        self._arrow("achieved", _from(centre, scale * achieved[None], moves), _GREEN, 1.0)

    def hide(self) -> None:
        """Draw none."""
        for handle in (*self._balls.values(), *self._lines.values(), *self._arrows.values()):
            if handle.visible:
                handle.visible = False

    def _long(self, force: np.ndarray) -> np.ndarray:
        return _FORCE * self._size * force / self._weight

    def _cones(self, points: np.ndarray, friction: float) -> np.ndarray:
        """Lines (L, 2, 3) of a cone on each point."""
        angle = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
        high = _CONE * self._size
        rim = high * np.stack([friction * np.cos(angle), friction * np.sin(angle), 1 + 0 * angle], 1)
        around = points[:, None] + rim
        along = np.stack([np.broadcast_to(points[:, None], around.shape), around], axis=2)
        ring = np.stack([around, np.roll(around, -1, axis=1)], axis=2)
        return np.concatenate([along[:, ::2], ring], axis=1).reshape(-1, 2, 3)

    def _ball(
        self, name: str, place: np.ndarray | None, colour: tuple[int, int, int], radius: float
    ) -> None:
        there = place is not None and bool(np.isfinite(place).all())
        if name not in self._balls:
            if not there:
                return
            self._balls[name] = self._scene.add_icosphere(
                f"{self._root}/{name}", radius * self._size, colour, cast_shadow=False
            )
        ball = self._balls[name]
        if place is not None and there:
            ball.position = place
        if ball.visible != there:
            ball.visible = there

    def _line(self, name: str, lines: np.ndarray, colour: tuple[int, int, int]) -> None:
        if name not in self._lines:
            if not len(lines):
                return
            self._lines[name] = self._scene.add_line_segments(
                f"{self._root}/{name}", lines, colour, thickness=0.006 * self._size
            )
        handle = self._lines[name]
        if len(lines):
            handle.points = lines.astype(np.float32)
        if handle.visible != bool(len(lines)):
            handle.visible = bool(len(lines))

    def _arrow(
        self, name: str, arrows: np.ndarray, colour: tuple[int, int, int], thick: float
    ) -> None:
        if name not in self._arrows:
            if not len(arrows):
                return
            radius = 0.008 * thick * self._size
            self._arrows[name] = self._scene.add_arrows(
                f"{self._root}/{name}",
                arrows,
                colour,
                shaft_radius=radius,
                head_radius=2.5 * radius,
                head_length=6.0 * radius,
            )
        handle = self._arrows[name]
        if len(arrows):
            handle.points = arrows.astype(np.float32)
        if handle.visible != bool(len(arrows)):
            handle.visible = bool(len(arrows))


def _from(places: np.ndarray, vectors: np.ndarray, shown: bool) -> np.ndarray:
    """Arrows (K, 2, 3) from places along vectors (P, 3), those long enough to be seen."""
    if not shown:
        return np.zeros((0, 2, 3))
    seen = np.linalg.norm(vectors, axis=1) > 1e-3  # not so of NaN
    return np.stack([places, places + vectors], axis=1)[seen]
