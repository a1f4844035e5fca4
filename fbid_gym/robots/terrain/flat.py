"""Level ground."""

from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from fbid_gym.robots.terrain.grid import HeightGrid, plane
from fbid_gym.robots.terrain.levels import Tiles


@dataclass(frozen=True, eq=False)
class Flat:
    """The plane alone; a `Terrain`."""

    tiles: ClassVar[Tiles] = Tiles(1, np.inf)
    starts: np.ndarray
    clearing: float

    @property
    def grid(self) -> HeightGrid:
        """See `Terrain`."""
        return plane()

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """See `Terrain`."""

    def height(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """See `Terrain`."""
        return np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)))
