"""A board of rounded stones, [M10] IV.E."""

import numpy as np

from fbid_gym.robots.terrain.field import CLEARING, HALF_SIZE, Field, settled
from fbid_gym.robots.terrain.grid import HeightGrid

# In units of the robot's reach.
_CELL = 0.17
_ROCK_SPACING = 0.75
_ROCK_RADIUS = (0.4, 0.8)

_COLOUR = (0.55, 0.54, 0.52)


def random_rocks(
    reach: float, height: float, starts: np.ndarray, rng: np.random.Generator
) -> Field:
    """Lay stones about, the tallest of that height, m, for a robot of that reach, m.

    The places to start from (K, 2) m are kept free.
    """
    size, clearing = HALF_SIZE * reach, CLEARING * reach
    nodes = 2 * round(HALF_SIZE / _CELL) + 1
    line = np.linspace(-size, size, nodes)
    x, y = np.meshgrid(line, line)

    # One stone in every square of a coarser grid, anywhere in it.
    spacing = _ROCK_SPACING * reach
    squares = int(np.ceil(2 * size / spacing)) + 2
    outermost = -0.5 * squares * spacing
    index = np.stack(np.meshgrid(np.arange(squares), np.arange(squares)), axis=-1)
    centre = outermost + spacing * (index + rng.uniform(0.0, 1.0, index.shape))
    radius = reach * rng.uniform(*_ROCK_RADIUS, (squares, squares))
    top = height * rng.uniform(0.3, 1.0, (squares, squares))
    own = [np.floor((w - outermost) / spacing).astype(int) for w in (y, x)]
    elevation = np.zeros_like(x)
    for up in (-1, 0, 1):
        for right in (-1, 0, 1):
            square = tuple(
                np.clip(o + d, 0, squares - 1) for o, d in zip(own, (up, right), strict=True)
            )
            offset = np.hypot(x - centre[square][..., 0], y - centre[square][..., 1])
            # Half an ellipsoid.
            dome = np.sqrt(np.maximum(1.0 - (offset / radius[square]) ** 2, 0.0))
            elevation = np.maximum(elevation, top[square] * dome)
    elevation *= height / elevation.max()

    from_start = np.linalg.norm(np.stack([x, y], axis=-1)[..., None, :] - starts, axis=-1)
    # The board begins gently at its edge and around clearings, a cell's diagonal away from them:
    # the triangles at a node reach that far.
    diagonal = np.sqrt(2.0) * (line[1] - line[0])
    from_clearing = from_start.min(axis=-1) - clearing - diagonal
    free = np.minimum(from_clearing, size - np.maximum(abs(x), abs(y)))
    elevation *= np.clip(free / (0.5 * reach), 0.0, 1.0)
    corner, cell = line[[0, 0]], float(line[1] - line[0])
    grid = HeightGrid(corner, cell, settled(elevation))
    return Field(starts, clearing, grid=grid, colour=_COLOUR)
