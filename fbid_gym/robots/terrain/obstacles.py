"""Planks lying about on level ground, [M10] IV.E."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import mujoco
import numpy as np

from fbid_gym.robots.mjcf import unused
from fbid_gym.robots.scene import add_solid, collision_bits
from fbid_gym.robots.terrain.field import CLEARING, ENDLESS, HALF_SIZE, Tiles
from fbid_gym.robots.terrain.grid import HeightGrid

# In units of the robot's reach.
_PLANKS_PER_AREA = 0.13
_PLANK_LENGTH, _PLANK_WIDTH = (1.0, 4.0), (0.5, 1.0)


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Planks lying on the plane, one across the other at times."""

    tiles: ClassVar[Tiles] = ENDLESS

    starts: np.ndarray  # see `Field`
    clearing: float  # see `Field`
    centre: np.ndarray  # (B, 2) m
    heading: np.ndarray  # (B,) rad, of the long side
    half: np.ndarray  # (B, 2) m, half length and half width
    top: np.ndarray  # (B,) m, height
    cell: float  # m, edge of the square cells of `near`
    near: np.ndarray  # (R, R, L) planks that touch a cell, B where there are fewer than L

    @cached_property
    def grid(self) -> HeightGrid:
        """See `Field.grid`; the planks' sides are less steep in it."""
        half, cell = float(abs(self.centre).max() + self.half.max()), 0.5 * float(self.half.min())
        line = np.arange(-half, half + cell, cell)
        return HeightGrid(line[[0, 0]], cell, self.height(*np.meshgrid(line, line)))

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """See `Field.add_to`."""
        bits = collision_bits(spec)
        wood = unused("fbid_plank", spec.materials)
        spec.add_material(name=wood, rgba=[0.72, 0.58, 0.42, 1.0], specular=0.1)
        planks = zip(self.centre, self.heading, self.half, self.top, strict=True)
        for (x, y), turn, half, top in planks:
            place = {"size": [*half, 0.5 * top], "pos": [x, y, 0.5 * top]}
            place["quat"] = [np.cos(0.5 * turn), 0.0, 0.0, np.sin(0.5 * turn)]
            add_solid(spec, bits, type=mujoco.mjtGeom.mjGEOM_BOX, material=wood, **place)

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """See `Field.height`."""
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        size = len(self.near)
        row, column = (np.floor(v / self.cell).astype(int) + size // 2 for v in (y, x))
        outside = (np.minimum(row, column) < 0) | (np.maximum(row, column) >= size)
        plank = self.near[np.where(outside, 0, row), np.where(outside, 0, column)]
        known = np.minimum(plank, len(self.top) - 1)
        dx, dy = x[..., None] - self.centre[known, 0], y[..., None] - self.centre[known, 1]
        cosine, sine = np.cos(self.heading[known]), np.sin(self.heading[known])
        along, across = cosine * dx + sine * dy, cosine * dy - sine * dx
        half = self.half[known]
        on = (np.abs(along) <= half[..., 0]) & (np.abs(across) <= half[..., 1])
        on &= (plank < len(self.top)) & ~outside[..., None]
        return np.where(on, self.top[known], 0.0).max(axis=-1)


def random_obstacles(
    reach: float, height: float, starts: np.ndarray, rng: np.random.Generator
) -> Obstacles:
    """Lay planks about, from half of that height, m, to all of it, for a robot of that reach, m.

    The places to start from (K, 2) m are kept free.
    """
    size, clearing = HALF_SIZE * reach, CLEARING * reach
    count = round(_PLANKS_PER_AREA * (2 * HALF_SIZE) ** 2)
    centre = rng.uniform(-size, size, (count, 2))
    heading = rng.uniform(-np.pi, np.pi, count)
    sizes = [rng.uniform(*_PLANK_LENGTH, count), rng.uniform(*_PLANK_WIDTH, count)]
    half = 0.5 * reach * np.stack(sizes, axis=1)
    top = rng.uniform(0.5 * height, height, count)

    # Away with planks that reach into a clearing.
    offset = starts[:, None] - centre
    cosine, sine = np.cos(heading), np.sin(heading)
    along = np.abs(cosine * offset[..., 0] + sine * offset[..., 1]) - half[:, 0]
    across = np.abs(cosine * offset[..., 1] - sine * offset[..., 0]) - half[:, 1]
    gap = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
    kept = (gap > clearing).all(axis=0)
    centre, heading, half, top = (part[kept] for part in (centre, heading, half, top))

    cell = 2.0 * reach
    around = np.hypot(*half.T)  # radius of the circle about a plank
    edge = int(np.ceil((size + around.max()) / cell))
    middles = cell * (np.arange(-edge, edge) + 0.5)
    apart = np.abs(middles[:, None] - centre.T[:, None])  # (2, 2 edge, B)
    close = apart <= 0.5 * cell + around
    touching = close[1][:, None] & close[0]
    most = int(touching.sum(axis=-1).max())
    # Stable sorting puts the planks of a cell first, in order.
    order = np.argsort(~touching, axis=-1, kind="stable")[..., :most]
    near = np.where(np.take_along_axis(touching, order, axis=-1), order, len(top))
    return Obstacles(starts, clearing, centre, heading, half, top, cell, near)
