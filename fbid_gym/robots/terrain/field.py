"""Ground that is a height field: level, a board of stones, or patches that are hard to walk on."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.robots.mjcf import unused
from fbid_gym.robots.scene import add_solid, collision_bits
from fbid_gym.robots.terrain.grid import HeightGrid, plane

# Of obstacles and rocks, in reaches of the robot: half the square of ground that is not level, and
# radius of the places to start from.
HALF_SIZE, CLEARING = 28.0, 1.8

_SHALLOW = 1e-3  # m that a height field lies below the plane where the plane is the ground


class Tiles(NamedTuple):
    """Tiles for the robots: squares side by side along x, one for each level."""

    number: int  # of the tiles
    edge: float  # m; infinite where the ground never ends
    # (R, R) int64, which of `patches.PATCHES` the patches of each tile are, rows along y.
    kinds: np.ndarray = np.zeros((0, 0), np.int64)

    def left(self, level: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return which robots, (N,) bool, at places (N, 2) m, have left the tile of their level."""
        if self.edge == np.inf:
            return np.zeros(len(places), bool)
        x = places[:, 0] - level * self.edge
        return np.maximum(abs(x), abs(places[:, 1])) > 0.5 * self.edge

    def kind(self, places: np.ndarray) -> np.ndarray:
        """Return which kind of patch places (N, 2) m are on, (N,) int64; there have to be some."""
        share = (places / self.edge + 0.5) % 1.0
        column, row = np.minimum(share * len(self.kinds), len(self.kinds) - 1).astype(np.int64).T
        return self.kinds[row, column]


ENDLESS = Tiles(1, np.inf)  # one tile that never ends


@dataclass(frozen=True, eq=False)
class Field:
    """Ground on top of the plane z = 0, a height field."""

    # (K, 2) m, centres of level places; equally many on each tile, those of a tile in turn.
    starts: np.ndarray
    clearing: float  # m, radius of these places
    tiles: Tiles = ENDLESS  # where robots belong
    grid: HeightGrid = plane()  # its heights, for look-up in compiled code
    colour: tuple[float, float, float] = (0.0, 0.0, 0.0)  # red, green, blue, from 0 to 1

    @cached_property
    def _is_level(self) -> bool:
        return float(self.grid.elevation.max()) <= 0.0

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Add the ground to a robot's world; what is level is the plane that is there."""
        if self._is_level:
            return
        corner, cell, elevation = self.grid
        low, high = float(elevation.min()), float(elevation.max())
        half = 0.5 * cell * (np.array(elevation.shape[::-1]) - 1.0)
        name = unused("fbid_field", (*spec.hfields, *spec.materials, *spec.textures))
        spec.add_material(name=name, rgba=[*self.colour, 1.0], specular=0.1)
        (rows, columns), shares = elevation.shape, ((elevation - low) / (high - low)).ravel()
        size = [*half, high - low, 0.05]
        spec.add_hfield(name=name, size=size, nrow=rows, ncol=columns, userdata=shares)
        ground = {"type": mujoco.mjtGeom.mjGEOM_HFIELD, "hfieldname": name, "material": name}
        add_solid(spec, collision_bits(spec), pos=[*(corner + half), low], **ground)

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return how high the ground is, in m, at places x and y, of any one shape, in m."""
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        if self._is_level:
            return np.zeros(x.shape)
        places = np.stack([x.ravel(), y.ravel()], axis=1)
        return self.grid.heights(places[None]).reshape(x.shape)


def settled(elevation: np.ndarray) -> np.ndarray:
    """Return an elevation (R, C) in m whose lowest places leave the ground to the plane.

    Where both lay at the same height a foot would touch both.
    """
    return np.where(elevation < _SHALLOW, -_SHALLOW, elevation)
