"""Planks lying about on level ground, [M10] IV.E."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import mujoco
import numpy as np

from fbid_gym.robots.mjcf import unused
from fbid_gym.robots.scene import add_solid, collision_bits
from fbid_gym.robots.terrain.field import CLEARING, ENDLESS, HALF_SIZE, Tiles
from fbid_gym.robots.terrain.grid import HeightGrid

# In units of the robot's reach.
_PER_AREA, _LENGTH = 0.13, (1.0, 4.0)
_WIDTH = (0.5, 1.0)

Span = tuple[float, float]  # from the least to the most


class Planks(NamedTuple):
    """B planks, one across the other at times."""

    centre: np.ndarray  # (B, 2) m
    heading: np.ndarray  # (B,) rad, of the long side
    half: np.ndarray  # (B, 2) m, half length and half width
    top: np.ndarray  # (B,) height, in any unit

    def beyond(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how far places are beyond each plank's ends, and its sides: (..., B) m.

        Negative where they are between them.
        """
        dx, dy = np.asarray(x)[..., None], np.asarray(y)[..., None]
        dx, dy = dx - self.centre[:, 0], dy - self.centre[:, 1]
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        along, across = cosine * dx + sine * dy, cosine * dy - sine * dx
        return abs(along) - self.half[:, 0], abs(across) - self.half[:, 1]

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return how high they lie at places x and y; 0 beside them."""
        ends, sides = self.beyond(x, y)
        return np.where(np.maximum(ends, sides) <= 0.0, self.top, 0.0).max(axis=-1)


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Planks lying on the plane."""

    tiles: ClassVar[Tiles] = ENDLESS

    starts: np.ndarray  # see `Field`
    clearing: float  # see `Field`
    planks: Planks

    @cached_property
    def grid(self) -> HeightGrid:
        """See `Field.grid`; the planks' sides are less steep in it."""
        centre, _, sizes, _ = self.planks
        half, cell = float(abs(centre).max() + sizes.max()), 0.5 * float(sizes.min())
        line = np.arange(-half, half + cell, cell)
        elevation = np.array([self.height(line, line[[k]]) for k in range(len(line))])
        return HeightGrid(line[[0, 0]], cell, elevation)

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """See `Field.add_to`."""
        bits = collision_bits(spec)
        wood = unused("fbid_plank", spec.materials)
        spec.add_material(name=wood, rgba=[0.72, 0.58, 0.42, 1.0], specular=0.1)
        for (x, y), turn, half, top in zip(*self.planks, strict=True):
            place = {"size": [*half, 0.5 * top], "pos": [x, y, 0.5 * top]}
            place["quat"] = [np.cos(0.5 * turn), 0.0, 0.0, np.sin(0.5 * turn)]
            add_solid(spec, bits, type=mujoco.mjtGeom.mjGEOM_BOX, material=wood, **place)

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """See `Field.height`."""
        return self.planks.height(x, y)


def random_planks(
    per_area: float, length: Span, top: Span, edge: float, unit: float, rng: np.random.Generator
) -> Planks:
    """Lay planks about in a square of an edge, m; other lengths are in a unit of so many m."""
    count = round(per_area * (edge / unit) ** 2)
    centre = rng.uniform(-0.5 * edge, 0.5 * edge, (count, 2))
    heading = rng.uniform(-np.pi, np.pi, count)
    sizes = [rng.uniform(*length, count), rng.uniform(*_WIDTH, count)]
    half = 0.5 * unit * np.stack(sizes, axis=1)
    return Planks(centre, heading, half, rng.uniform(*top, count))


def random_obstacles(
    reach: float, height: float, starts: np.ndarray, rng: np.random.Generator
) -> Obstacles:
    """Lay planks about, from half of that height, m, to all of it, for a robot of that reach, m.

    The places to start from (K, 2) m are kept free.
    """
    edge, clearing = 2.0 * HALF_SIZE * reach, CLEARING * reach
    planks = random_planks(_PER_AREA, _LENGTH, (0.5 * height, height), edge, reach, rng)
    # Away with planks that reach into a clearing.
    ends, sides = planks.beyond(*starts.T)
    gap = np.hypot(np.maximum(ends, 0.0), np.maximum(sides, 0.0))
    kept = (gap > clearing).all(axis=0)
    return Obstacles(starts, clearing, Planks(*(part[kept] for part in planks)))
