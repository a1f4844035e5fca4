"""The support polygon of N robots: what their centre of pressure can reach."""

from dataclasses import dataclass

import numpy as np

_SIDES = 48
_ANGLES = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
NORMALS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
"""(48, 2) unit normals of the half-planes whose intersection stands for a polygon: exact for edges
along one of them, and at a corner of any other too wide by 0.2 % of the polygon's size at most."""

_FAR = 1e3
_ROUNDS = 12
_INSIDE = 1e-6  # m


@dataclass(frozen=True, eq=False)
class Polygon:
    """N convex polygons.

    Attributes:
        centre: (N, 2) m, a point inside.
        reach: (N, 48) m, from the centre to the edge's half-planes along `NORMALS`.
    """

    centre: np.ndarray
    reach: np.ndarray

    @classmethod
    def around(cls, points: np.ndarray, active: np.ndarray) -> "Polygon":
        """Take the hull of the active ones of P points.

        Args:
            points: (N, P, 2) m.
            active: (N, P) bool, one of each robot's at least.
        """
        weight = active / np.maximum(active.sum(axis=1, keepdims=True), 1)
        centre = np.vecmat(weight, points)
        out = (points - centre[:, None]) @ NORMALS.T
        return cls(centre, np.where(active[..., None], out, -_FAR).max(axis=1))

    def margin(self, point: np.ndarray) -> np.ndarray:
        """Return the distance (N,) m of points (N, 2) to the nearest edge; negative outside."""
        beyond = (point - self.centre) @ NORMALS.T - self.reach
        return np.asarray(-beyond.max(axis=1))

    def nearest(self, point: np.ndarray) -> np.ndarray:
        """Return points (N, 2) of the polygons: those given if inside, else some near them.

        They are moved onto the half-plane they violate most until they violate none; where that
        meets a corner, it is not quite the nearest point.
        """
        found = point - self.centre
        for _ in range(_ROUNDS):
            beyond = found @ NORMALS.T - self.reach
            worst = beyond.argmax(axis=1)
            excess = np.take_along_axis(beyond, worst[:, None], axis=1)
            if excess.max() <= _INSIDE:
                break
            found = found - np.maximum(excess, 0.0) * NORMALS[worst]
        return np.asarray(self.centre + found)
