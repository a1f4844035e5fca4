"""Ground heights on a square grid: what MuJoCo's height fields hold, looked up in compiled code."""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel


class HeightGrid(NamedTuple):
    """Ground on top of the plane z = 0; the plane alone outside the grid."""

    corner: np.ndarray  # (2,) m, x and y of the first node
    cell: float  # m between nodes
    elevation: np.ndarray  # (R, C) m at the nodes, at least 0; rows along y, columns along x

    def heights(self, points: np.ndarray) -> np.ndarray:
        """Return the heights (N, K) m below points (N, K, 2 or 3) m."""
        return heights_below(self, points)


def plane() -> HeightGrid:
    """Return the plane alone."""
    return HeightGrid(np.zeros(2), 1.0, np.zeros((2, 2)))


@kernel
def heights_below(grid: HeightGrid, points: np.ndarray) -> np.ndarray:
    """Return how high the ground is, (N, K) m, below points (N, K, 2 or 3) m."""
    count, places = points.shape[:2]
    found = np.empty((count, places))
    for i in range(count):
        for k in range(places):
            found[i, k] = height_at(grid, points[i, k, 0], points[i, k, 1])
    return found


@compiled
def height_at(grid: HeightGrid, x: float, y: float) -> float:
    """Return how high the ground is, in m, at a place, in m.

    As MuJoCo has it, each cell is two triangles, split from (row, column) to (row + 1, column + 1).
    """
    u, v = (x - grid.corner[0]) / grid.cell, (y - grid.corner[1]) / grid.cell
    rows, columns = grid.elevation.shape
    if not (0.0 <= u <= columns - 1.0 and 0.0 <= v <= rows - 1.0):
        return 0.0
    column, row = min(int(math.floor(u)), columns - 2), min(int(math.floor(v)), rows - 2)
    s, t = u - column, v - row
    corner, far = grid.elevation[row, column], grid.elevation[row + 1, column + 1]
    if s > t:
        right = grid.elevation[row, column + 1]
        found = corner + s * (right - corner) + t * (far - right)
    else:
        above = grid.elevation[row + 1, column]
        found = corner + t * (above - corner) + s * (far - above)
    return max(found, 0.0)
