"""Films side by side: each in its place, from its first picture to its last, which then stays."""

import io

import numpy as np
from PIL import Image

from eval.grid import tiled, webp


def film(shade: int, length: int) -> list[np.ndarray]:
    return [np.full((48, 64, 3), shade + 20 * k, np.uint8) for k in range(length)]


def test_films_lie_row_by_row_and_wait_for_the_longest():
    films = {"a": film(50, 2), "b": film(100, 3), "c": film(150, 1)}
    frames = tiled(films, (32, 24), 2)
    assert [frame.shape for frame in frames] == [(48, 64, 3)] * 3
    last = frames[-1]
    assert last[2, 30, 0] == 70 and last[2, 60, 0] == 140 and last[26, 30, 0] == 150
    assert (last[24:, 32:] == 255).all()  # nobody's place
    with Image.open(io.BytesIO(webp(frames, 10.0))) as picture:
        assert picture.size == (64, 48) and picture.n_frames == 3
