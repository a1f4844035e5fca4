"""Films side by side: each in its place, from its first picture to its last, which then stays."""

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from eval.grid import GridConfig, run, tiled, webp
from fbid_gym.errors import InvalidValueError

_JOINTS = "QuadrupedWalk-v1/joint_position"


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


def test_policies_are_filmed_side_by_side_on_their_own_robots_or_on_all(tmp_path, capsys):
    sources, out = (
        [Path(f"shipped:{name}") for name in ("any-quadruped", _JOINTS)],
        tmp_path / "f.webp",
    )
    for robots, size in (((), (480, 180)), (("go1", "go1", "quadruped"), (720, 360))):
        run(GridConfig(tuple(sources), out, 0.1, robots, columns=3))
        with Image.open(out) as picture:
            assert picture.size == size
    assert "6 of 6 stay up" in capsys.readouterr().out
    with pytest.raises(InvalidValueError, match="at least one policy"):
        run(GridConfig((), out))
