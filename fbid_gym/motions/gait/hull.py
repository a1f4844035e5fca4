"""The convex hull of points on the ground: where the centre of pressure can be."""

import numpy as np

from fbid_gym.compiled import compiled

_OUTSIDE = 1e-12  # m^2


@compiled
def nearest_in_hull(points: np.ndarray, place: tuple[float, float]) -> tuple[float, float]:
    """Return the point of the hull of `points` (P, 2) nearest to a place; P is at least 1.

    Edges of the hull join two of the points, and all that joins two of them is in the hull. So the
    nearest on all those segments is the answer, unless the place lies within.
    """
    x, y = place
    best, near_x, near_y = np.inf, x, y
    for i in range(len(points)):
        for j in range(i + 1):
            from_x, from_y = points[i, 0], points[i, 1]
            along_x, along_y = points[j, 0] - from_x, points[j, 1] - from_y
            size = along_x**2 + along_y**2
            share = 0.0
            if size > 0.0:
                share = ((x - from_x) * along_x + (y - from_y) * along_y) / size
                share = min(max(share, 0.0), 1.0)
            found_x, found_y = from_x + share * along_x, from_y + share * along_y
            distance = (x - found_x) ** 2 + (y - found_y) ** 2
            if distance < best:
                best, near_x, near_y = distance, found_x, found_y
    # Outside, the hull lies beyond the line through the nearest point, as seen from the place.
    for i in range(len(points)):
        beyond = (points[i, 0] - near_x) * (x - near_x) + (points[i, 1] - near_y) * (y - near_y)
        if beyond > _OUTSIDE:
            return x, y
    return near_x, near_y
