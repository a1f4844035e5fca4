"""Overlays on a robot, as shapes: once for MuJoCo's pictures and for the live page."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs.insight import Insight
from fbid_gym.options import check_fields


@dataclass(frozen=True)
class RenderOptions:
    """Choice of overlays; none by default."""

    forces: bool = False
    """Contact forces: measured (green), and commanded (orange), which is what the layer's torques
    ask of contacts that hold, by the controller's model. A point's even share of the weight is a
    quarter of the robot's size."""
    cones: bool = False
    """Friction cones (grey) of the points that carry, as the layer assumes them; with friction 0.7
    where it assumes none. The rim is as high as the measured force, which is to point into it."""
    com: bool = False
    """Centre of mass, and what it is above (cyan)."""
    capture_point: bool = False
    """Capture point (violet): where the robot would have to stand to come to rest."""
    support: bool = False
    """Support polygon of the points that carry, and centre of pressure (yellow)."""
    footholds: bool = False
    """Where feet in the air shall land (blue)."""
    acceleration: bool = False
    """Acceleration of the body, above it: desired (red) by `base_acceleration` and `com_wrench`,
    achieved (green) in the last policy step. At most a robot long."""

    def __post_init__(self) -> None:
        """Check them."""
        check_fields(self, "render option {}")

    @property
    def any(self) -> bool:
        """Whether anything is drawn."""
        return self != RenderOptions()


LABELS = {
    "forces": "contact forces (green: measured, orange: commanded)",
    "cones": "friction cones",
    "com": "centre of mass (cyan)",
    "capture_point": "capture point (violet)",
    "support": "support polygon, centre of pressure (yellow)",
    "footholds": "next footholds (blue)",
    "acceleration": "body's acceleration (red: desired, green: achieved)",
}
"""Each render option in a few words."""

EVERYTHING = RenderOptions(**dict.fromkeys(LABELS, True))

Colour = tuple[int, int, int]

_GREEN, _ORANGE, _RED, _YELLOW = (40, 170, 80), (245, 150, 30), (220, 40, 60), (240, 200, 30)
_VIOLET, _BLUE, _CYAN, _GREY = (150, 70, 210), (40, 120, 240), (0, 190, 210), (120, 130, 140)
_CORNERS, _RIBS = 24, 6  # of a cone
# Shares of the robot's size: a point's even share of the weight, 1 m/s^2.
_FORCE, _ACCELERATION = 0.25, 0.15


@dataclass(frozen=True, eq=False)
class Mark:
    """A ball, or lines or arrows of one colour."""

    name: str  # the same as long as it is the same thing that moves
    shape: Literal["ball", "lines", "arrows"]  # what it is
    colour: Colour  # red, green, blue, 0 to 255
    radius: float  # m, of the ball, of a line, of an arrow's shaft
    place: np.ndarray  # (3,) m, world
    # (K, 2, 3) m from the place, where each line or arrow begins and ends; none of a ball.
    ends: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3)))


def size_of(stance: Stance) -> float:
    """Measure a robot that stands, m: marks are sized by it."""
    return float(2.3 * stance.home_base[2] + 3.5 * stance.radius) / 2.5


def marks(shown: RenderOptions, seen: Insight, size: float, weight: float) -> Iterator[Mark]:
    """Yield what is to be drawn of a robot now; nothing that is nowhere.

    The robot's size is in m, see `size_of`, its weight in N.
    """
    newton = _FORCE * size * len(seen.points) / weight  # m
    forces = [("measured", seen.measured, _GREEN, 1.0), ("commanded", seen.commanded, _ORANGE, 0.7)]
    for name, force, colour, thick in forces if shown.forces else ():
        ends = _from(seen.points - seen.com, newton * force)
        yield Mark(name, "arrows", colour, 0.01 * thick * size, seen.com, ends)
    if shown.cones:
        for number, (point, force) in enumerate(zip(seen.points, seen.measured, strict=True)):
            if force[2] > 0.0:
                ends = newton * force[2] * _cone(seen.friction)
                yield Mark(f"cone{number}", "lines", _GREY, 0.003 * size, point, ends)
    if shown.support and len(seen.support):
        radius, corners = 0.006 * size, seen.support - seen.com
        edges = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
        above = seen.com + np.array([0.0, 0.0, radius])  # the ground
        yield Mark("support", "lines", _YELLOW, radius, above, edges)
        yield Mark("pressure", "ball", _YELLOW, 0.022 * size, seen.pressure)
    if shown.com:
        yield Mark("com", "ball", _CYAN, 0.03 * size, seen.com)
        down = np.array([0.0, 0.0, seen.capture_point[2] - seen.com[2]])
        plumb = np.stack([np.zeros(3), down])[None]
        yield Mark("plumb line", "lines", _CYAN, 0.004 * size, seen.com, plumb)
    if shown.capture_point:
        yield Mark("capture point", "ball", _VIOLET, 0.025 * size, seen.capture_point)
    for number, place in enumerate(seen.footholds if shown.footholds else ()):
        yield Mark(f"foothold{number}", "ball", _BLUE, 0.025 * size, place)
    if shown.acceleration:
        centre = seen.com + np.array([0.0, 0.0, 0.25 * size])
        vectors = [("desired", seen.desired, _RED, 0.7), ("achieved", seen.achieved, _GREEN, 1.0)]
        for name, vector, colour, thick in vectors:
            arrow = _ACCELERATION * size * vector
            arrow = arrow * min(1.0, size / max(float(np.linalg.norm(arrow)), 1e-9))
            ends = _from(np.zeros((1, 3)), arrow[None])
            yield Mark(name, "arrows", colour, 0.01 * thick * size, centre, ends)


def _cone(friction: float) -> np.ndarray:
    """Lines (L, 2, 3) of a friction cone of height 1 on the origin."""
    angle = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
    rim = np.stack([friction * np.cos(angle), friction * np.sin(angle), np.ones(_CORNERS)], 1)
    along = np.stack([np.zeros_like(rim), rim], axis=1)
    ring = np.stack([rim, np.roll(rim, -1, axis=0)], axis=1)
    return np.concatenate([along[:: _CORNERS // _RIBS], ring])


def _from(places: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Arrows (K, 2, 3) from places along vectors (P, 3), those long enough to be seen."""
    seen = np.linalg.norm(vectors, axis=1) > 1e-3  # not so of NaN
    return np.stack([places, places + vectors], axis=1)[seen]
