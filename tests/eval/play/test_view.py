"""Whatever the window, robots are in the part of it that is seen."""

import numpy as np
import pytest

pytest.importorskip("viser", reason="the live page is not installed: make play")

from eval.play.view import view

SIZE, HEIGHT, FOV = 0.5, 0.3, np.radians(75.0)


def pictured(place: np.ndarray, aspect: float) -> np.ndarray:
    """(2,) where a place is in the picture: right and up, 1 at its edges."""
    position, look_at = view(SIZE, HEIGHT, aspect, FOV)
    ahead = (look_at - position) / np.linalg.norm(look_at - position)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    seen = place - position
    across = np.array([seen @ right / aspect, seen @ np.cross(right, ahead)])
    return across / (seen @ ahead) / np.tan(0.5 * FOV)


@pytest.mark.parametrize(("aspect", "lowest"), [(1.8, -1.0), (1.1, -1.0), (0.7, 0.0), (0.46, 0.0)])
def test_robots_are_seen_whole(aspect, lowest):
    beside = 0.7 * SIZE  # two robots are so far from the middle
    for x in (-0.5, 0.5):
        for y in (-1.0, 0.0, 1.0):
            for z in (0.0, 1.2):
                right, up = pictured(np.array([x * SIZE, y * beside, z * HEIGHT]), aspect)
                assert abs(right) < 1.0 and lowest < up < 1.0
