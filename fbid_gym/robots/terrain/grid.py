"""Ground heights on a square grid: what MuJoCo's height fields hold, looked up in compiled code."""

import math
from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.robots.scene import add_solid, collision_bits

_SHALLOW = 1e-3  # m that a height field lies below the plane where the plane is the ground


class HeightGrid(NamedTuple):
    """Ground on top of the plane z = 0; the plane alone outside the grid.

    Attributes:
        corner: (2,) m, x and y of the first node.
        cell: m between nodes.
        elevation: (R, C) m at the nodes, at least 0; rows along y, columns along x.
    """

    corner: np.ndarray
    cell: float
    elevation: np.ndarray


def plane() -> HeightGrid:
    """Return the plane alone."""
    return HeightGrid(np.zeros(2), 1.0, np.zeros((2, 2)))


@kernel
def heights(grid: HeightGrid, places: np.ndarray) -> np.ndarray:
    """Return how high the ground is, (K,) m, at places (K, 2) m."""
    found = np.empty(len(places))
    for k in range(len(places)):
        found[k] = height_at(grid, places[k, 0], places[k, 1])
    return found


def heights_at(grid: HeightGrid, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return how high the ground is, in m, at places in m; of the shape that x and y have."""
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    return heights(grid, np.stack([x.ravel(), y.ravel()], axis=1)).reshape(x.shape)


@kernel
def heights_below(grid: HeightGrid, points: np.ndarray) -> np.ndarray:
    """Return how high the ground is, (N, F) m, below points (N, F, 3) m."""
    count, feet = points.shape[:2]
    found = np.empty((count, feet))
    for i in range(count):
        for foot in range(feet):
            found[i, foot] = height_at(grid, points[i, foot, 0], points[i, foot, 1])
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


def settled(elevation: np.ndarray) -> np.ndarray:
    """Return an elevation (R, C) in m whose lowest places leave the ground to the plane.

    Where both lay at the same height a foot would touch both.
    """
    return np.where(elevation < _SHALLOW, -_SHALLOW, elevation)


def add_height_field(
    spec: mujoco.MjSpec, grid: HeightGrid, name: str, colour: tuple[float, float, float]
) -> None:
    """Add a grid to a robot's world, unless it is nothing but the plane."""
    low, high = float(grid.elevation.min()), float(grid.elevation.max())
    if high <= 0.0:
        return
    half = 0.5 * grid.cell * (np.array(grid.elevation.shape[::-1]) - 1.0)
    spec.add_material(name=name, rgba=[*colour, 1.0], specular=0.1)
    spec.add_hfield(
        name=name,
        size=[*half, high - low, 0.05],
        nrow=grid.elevation.shape[0],
        ncol=grid.elevation.shape[1],
        userdata=((grid.elevation - low) / (high - low)).ravel(),
    )
    add_solid(
        spec,
        collision_bits(spec),
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname=name,
        pos=[*(grid.corner + half), low],
        material=name,
    )
