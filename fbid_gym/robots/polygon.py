"""The hull of a few points in the plane."""

import numpy as np

_FEWEST, _MOST = 4, 8
_GRID = 1e4
_SPARED = 0.03  # share of the area that a corner less may cost


def few_corners(points: np.ndarray) -> list[int]:
    """Indices of the corners that span points (K, 2): counterclockwise, no more than needed.

    Where the hull has many corners, those that cost the least area go: down to eight, and on to
    four as long as each costs next to nothing.
    """
    corners = convex_hull(points)
    while len(corners) > _FEWEST:
        shape = points[corners]
        before, after = np.roll(shape, 1, axis=0) - shape, np.roll(shape, -1, axis=0) - shape
        lost = 0.5 * np.abs(_cross(before, after))
        least = int(np.argmin(lost))
        area = 0.5 * abs(float(np.sum(_cross(shape, np.roll(shape, -1, axis=0)))))
        if len(corners) <= _MOST and lost[least] > _SPARED * area:
            break
        del corners[least]
    return corners


def convex_hull(points: np.ndarray) -> list[int]:
    """Indices of the corners of the hull of points (K, 2), counterclockwise.

    Andrew's monotone chain, exact on a grid of a ten-thousandth of the whole: what is level or in
    line but for rounding is so there.
    """
    low, size = points.min(axis=0), float(np.ptp(points, axis=0).max())
    grid = np.round((points - low) * (_GRID / max(size, 1e-9))).astype(np.int64)
    _, first = np.unique(grid, axis=0, return_index=True)  # in order of x, then y
    order = first.tolist()
    if len(order) == 1:
        return order
    chains = []
    for turn in (order, order[::-1]):
        chain: list[int] = []
        for index in turn:
            while len(chain) > 1:
                last, previous = grid[chain[-1]], grid[chain[-2]]
                if _cross(last - previous, grid[index] - previous) > 0:
                    break
                chain.pop()
            chain.append(index)
        chains += chain[:-1]
    return chains


def margin_within(points: np.ndarray, place: np.ndarray) -> float:
    """Return how far a place (2,) lies within the hull of points (P, 2), m; negative outside."""
    corners = points[convex_hull(points)]
    ahead = np.roll(corners, -1, axis=0) - corners
    to_place = place - corners
    length = np.linalg.norm(ahead, axis=1)
    if len(corners) < 3:
        along = ahead[0] / max(length[0], 1e-12)
        nearest = corners[0] + along * np.clip(to_place[0] @ along, 0.0, length[0])
        return -float(np.linalg.norm(place - nearest))
    return float((_cross(ahead, to_place) / length).min())


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
