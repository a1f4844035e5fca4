"""The support polygon of N robots: what their centre of pressure can reach."""

from dataclasses import dataclass

import numpy as np

_ROUNDS = 12
_INSIDE = 1e-6  # m
_SAME = 1e-9  # m, between points through which there is no line


@dataclass(frozen=True, eq=False)
class Polygon:
    """N convex polygons, each the intersection of K half-planes; edges are among them.

    Attributes:
        centre: (N, 2) m, a point inside.
        normals: (N, K, 2) unit vectors, outwards.
        reach: (N, K) m, from the centre to the edge of the half-plane.
    """

    centre: np.ndarray
    normals: np.ndarray
    reach: np.ndarray

    @classmethod
    def around(cls, points: np.ndarray, active: np.ndarray) -> "Polygon":
        """Take the hull of the active ones of P points.

        An edge of the hull goes through two of the points: the half-planes are those that hold the
        active points, perpendicular to each line through two points.

        Args:
            points: (N, P, 2) m.
            active: (N, P) bool, one of each robot's at least.
        """
        weight = active / np.maximum(active.sum(axis=1, keepdims=True), 1)
        centre = np.vecmat(weight, points)
        # In the place of a point that does not count, one that does.
        some = active.argmax(axis=1)
        counted = np.where(active[..., None], points, points[np.arange(len(points)), some, None])
        first, second = np.triu_indices(points.shape[1], 1)
        along = points[:, second] - points[:, first]
        along /= np.maximum(np.sqrt(np.vecdot(along, along)), _SAME)[..., None]
        aside = np.stack([along[..., 1], -along[..., 0]], axis=1)
        out = (counted - centre[:, None]) @ aside
        normals = np.concatenate([aside, -aside], axis=2).mT
        return cls(centre, normals, np.concatenate([out.max(axis=1), -out.min(axis=1)], axis=1))

    def _beyond(self, place: np.ndarray) -> np.ndarray:
        """How far places (N, 2), from the centre, are beyond each half-plane: (N, K) m."""
        return np.matvec(self.normals, place) - self.reach

    def margin(self, point: np.ndarray) -> np.ndarray:
        """Return the distance (N,) m of points (N, 2) to the nearest edge; negative outside."""
        return np.asarray(-self._beyond(point - self.centre).max(axis=1))

    def nearest(self, point: np.ndarray) -> np.ndarray:
        """Return points (N, 2) of the polygons: those given if inside, else some near them.

        They are moved onto the half-plane they violate most until they violate none; where that
        meets a corner, it is not quite the nearest point.
        """
        found, rows = point - self.centre, np.arange(len(point))
        for _ in range(_ROUNDS):
            beyond = self._beyond(found)
            worst = beyond.argmax(axis=1)
            excess = beyond[rows, worst, None]
            if excess.max() <= _INSIDE:
                break
            found = found - np.maximum(excess, 0.0) * self.normals[rows, worst]
        return np.asarray(self.centre + found)
