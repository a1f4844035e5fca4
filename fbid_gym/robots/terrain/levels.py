"""Ground of a chosen difficulty, or of several levels of it side by side: patches on square tiles.

One model serves all robots and all levels, so that a robot moves to harder ground by starting its
next episode in another place.
"""

import numpy as np

from fbid_gym.robots.terrain.field import Field, Tiles, settled
from fbid_gym.robots.terrain.grid import HeightGrid
from fbid_gym.robots.terrain.patches import CLEARING, EDGE, PATCHES, Places

NUM_LEVELS = 11  # of a curriculum: difficulties 0, 0.1, … 1
_PATCHES = 5  # along a tile's edge; robots start on the inner ones
_CELL = 0.14  # heights of the centre of mass
_COLOUR = (0.66, 0.62, 0.55)


def make_levels(kind: str, unit: float, reach: float, difficulties: np.ndarray, seed: int) -> Field:
    """Make a terrain with levels of these difficulties (L,), each from 0 to 1.

    Its patches are of one of the kinds of `PATCHES`, or of all if "mixed"; lengths in them are in
    heights of the robot's centre of mass, `unit` (m), of which its feet clear the share `reach`.
    The seed decides what is random, which is the same for all levels.
    """
    nodes = round(EDGE / _CELL)
    line = (np.arange(nodes + 1) / nodes - 0.5) * EDGE
    places = Places(*np.meshgrid(line, line), reach)
    whole = np.zeros((_PATCHES * nodes + 1, len(difficulties) * _PATCHES * nodes + 1))
    for level, difficulty in enumerate(difficulties):
        rng = np.random.default_rng(seed)
        kinds = _kinds(kind, rng)
        for row in range(_PATCHES):
            for column in range(_PATCHES):
                first = row * nodes, (level * _PATCHES + column) * nodes
                part = PATCHES[kinds[row, column]].make(places, float(difficulty), rng)
                block = tuple(slice(start, start + nodes + 1) for start in first)
                whole[block] = np.maximum(whole[block], part)
    cell, edge = EDGE / nodes * unit, _PATCHES * EDGE * unit
    elevation = settled(whole * unit)
    grid = HeightGrid(np.array([-0.5 * edge, -0.5 * edge]), cell, elevation)
    inner = (np.arange(1, _PATCHES - 1) - 0.5 * (_PATCHES - 1)) * EDGE * unit
    corner = np.stack(np.meshgrid(inner, inner), axis=-1).reshape(-1, 2)
    starts = [corner + np.array([level * edge, 0.0]) for level in range(len(difficulties))]
    names = list(PATCHES)
    numbers = np.array([[names.index(k) for k in row] for row in kinds])
    tiles = Tiles(len(difficulties), edge, numbers)
    return Field(np.concatenate(starts), CLEARING * unit, tiles, grid, _COLOUR)


def _kinds(kind: str, rng: np.random.Generator) -> np.ndarray:
    """Names of the patches of a tile: of all kinds, equally many but for one, if mixed."""
    if kind != "mixed":
        return np.full((_PATCHES, _PATCHES), kind)
    inner, every = _PATCHES - 2, list(PATCHES)
    kinds = rng.choice(every, (_PATCHES, _PATCHES))
    # Robots start on the inner patches: all kinds are among these.
    order = rng.permutation(np.resize(every, inner**2))
    kinds[1:-1, 1:-1] = order.reshape(inner, inner)
    return kinds
