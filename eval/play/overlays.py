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
_PLACES = ("points", "com", "capture_point", "pressure", "support", "footholds")
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
        self._scene, self._root = server.scene, f"{root}/overlays"
        self._size, self._weight = size, weight
        # Goes along with the robot: a browser that is late is late for both.
        self._frame = server.scene.add_frame(self._root, show_axes=False)
        self._balls: dict[str, viser.IcosphereHandle] = {}
        self._lines: dict[str, viser.LineSegmentsHandle] = {}
        self._cones: dict[str, viser.LineSegmentsHandle] = {}
        self._arrows: dict[str, viser.ArrowsHandle] = {}

    def draw(self, shown: set[str], seen: Insight, achieved: np.ndarray) -> None:
        """Draw the kinds that are shown.

        Args:
            shown: of `LABELS`.
            seen: of the robot.
            achieved: (3,) m/s^2, acceleration of its centre of mass.
        """
        none, origin = np.zeros((0, 2, 3)), seen.com
        self._frame.position = origin
        seen = seen._replace(
            **{name: getattr(seen, name) - origin for name in _PLACES},
        )
        loaded = np.linalg.norm(seen.measured, axis=1) > 0.0
        forces = "forces" in shown
        self._arrow("measured", _from(seen.points, self._long(seen.measured), forces), _GREEN, 1.0)
        asked = _from(seen.points, self._long(seen.commanded), forces)
        self._arrow("commanded", asked, _ORANGE, 0.7)
        for place, point in enumerate(seen.points):
            stands = "cones" in shown and bool(loaded[place])
            self._cone(f"cone{place}", point if stands else None, seen.friction)
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
        desired, achieved = (
            self._short(scale * vector[None]) for vector in (seen.desired, achieved)
        )
        self._arrow("desired", _from(centre, desired, moves), _RED, 0.7)
        self._arrow("achieved", _from(centre, achieved, moves), _GREEN, 1.0)

    def hide(self) -> None:
        """Draw none."""
        for kept in (self._balls, self._lines, self._cones, self._arrows):
            for handle in kept.values():
                _put(handle, None)

    def _long(self, force: np.ndarray) -> np.ndarray:
        return _FORCE * self._size * force / self._weight

    def _short(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors (K, 3), none longer than the robot."""
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        return vectors * np.minimum(1.0, self._size / np.maximum(length, 1e-9))

    def _cone(self, name: str, place: np.ndarray | None, friction: float) -> None:
        name = f"{name} {friction:g}"
        if name not in self._cones:
            if place is None:
                return
            lines = self._size * cone(friction)
            self._cones[name] = self._scene.add_line_segments(
                f"{self._root}/{name}", lines, _GREY, thickness=0.004 * self._size
            )
        _put(self._cones[name], place)

    def _ball(
        self, name: str, place: np.ndarray | None, colour: tuple[int, int, int], radius: float
    ) -> None:
        if place is not None and not np.isfinite(place).all():
            place = None
        if name not in self._balls:
            if place is None:
                return
            self._balls[name] = self._scene.add_icosphere(
                f"{self._root}/{name}", radius * self._size, colour, cast_shadow=False
            )
        _put(self._balls[name], place)

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


def cone(friction: float) -> np.ndarray:
    """Lines (L, 2, 3) of a friction cone on the origin, of a quarter of a unit's height."""
    angle = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
    circle = np.stack([friction * np.cos(angle), friction * np.sin(angle), np.ones(_CORNERS)], 1)
    rim = _CONE * circle
    along = np.stack([np.zeros_like(rim), rim], axis=1)
    ring = np.stack([rim, np.roll(rim, -1, axis=0)], axis=1)
    return np.concatenate([along[::2], ring])


def _put(handle: viser.SceneNodeHandle, place: np.ndarray | None) -> None:
    """Show a node at a place; hide it at None."""
    if place is not None:
        handle.position = place
    if handle.visible != (place is not None):
        handle.visible = place is not None


def _from(places: np.ndarray, vectors: np.ndarray, shown: bool) -> np.ndarray:
    """Arrows (K, 2, 3) from places along vectors (P, 3), those long enough to be seen."""
    if not shown:
        return np.zeros((0, 2, 3))
    seen = np.linalg.norm(vectors, axis=1) > 1e-3  # not so of NaN
    return np.stack([places, places + vectors], axis=1)[seen]
