"""Terrains with a difficulty: 0 is level, more is rougher, heights are where rays hit them."""

import numpy as np
import pytest

from fbid_gym.robots import Robot, load
from fbid_gym.robots.terrain import LEVELLED, NUM_LEVELS, Terrain, make_terrain
from fbid_gym.robots.terrain.patches import CLEARING
from tests.pairs import pairs

ROBOTS = ("go1", "biped")


def spread(terrain: Terrain, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Places all over the first tile."""
    half = 0.5 * terrain.tiles.edge
    line = np.linspace(-half, half, count)
    x, y = np.meshgrid(line, line)
    return x, y


@pytest.fixture(params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> Robot:
    return load(request.param)


@pytest.mark.parametrize(("name", "robot"), pairs(LEVELLED, ROBOTS, 1), indirect=["robot"])
def test_difficulty_zero_is_level_and_more_is_rougher(name: str, robot: Robot) -> None:
    heights = []
    for difficulty in (0.0, 0.25, 0.5, 0.75, 1.0):
        terrain = make_terrain(name, robot, difficulty=difficulty, seed=1)
        heights.append(terrain.height(*spread(terrain)))
    assert not heights[0].any()
    roughness = [np.abs(np.diff(each, axis=1)).mean() for each in heights]
    assert (np.diff(roughness) > 0.0).all()
    highest = [each.max() for each in heights]
    assert (np.diff(highest) > 0.0).all()


@pytest.mark.parametrize(("name", "robot"), pairs(LEVELLED, ROBOTS, 1), indirect=["robot"])
def test_starts_are_level_and_far_from_the_end(name: str, robot: Robot) -> None:
    terrain = make_terrain(name, robot, difficulty=1.0, seed=2)
    angle, share = np.meshgrid(np.linspace(0, 2 * np.pi, 24), np.linspace(0, 1.0, 8))
    ring = terrain.clearing * share[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    around = terrain.starts[:, None, None] + ring
    height = terrain.height(around[..., 0], around[..., 1]).reshape(len(terrain.starts), -1)
    np.testing.assert_allclose(height, np.tile(height[:, :1], (1, height.shape[1])), atol=1e-12)
    end = 0.5 * terrain.tiles.edge - abs(terrain.starts).max()
    assert end > 10.0 * terrain.clearing
    level = np.zeros(len(terrain.starts), np.int64)
    assert not terrain.tiles.left(level, terrain.starts).any()
    assert terrain.tiles.left(level, terrain.starts + [terrain.tiles.edge, 0.0]).all()


def test_gaps_are_alike_and_as_wide_as_their_difficulty_says(robot: Robot) -> None:
    """Along a line from the middle of a patch, in heights of the centre of mass."""
    out, cell, found = np.linspace(0.0, 5.5, 20_001), 0.14, []
    difficulties = np.linspace(0.05, 1.0, 20)
    for difficulty in difficulties:
        terrain = make_terrain("gaps", robot, difficulty=float(difficulty))
        unit, (x, y) = terrain.clearing / CLEARING, terrain.starts[4]
        profile = terrain.height(x + unit * out, np.full(len(out), y))
        low = np.flatnonzero(np.diff((profile < 0.5 * profile[0]).astype(int)))
        begins, ends = out[low[::2]], out[low[1::2]]
        np.testing.assert_allclose(np.diff(begins), 2.0, atol=cell)
        found.append(ends - begins)
    widths = np.array(found)
    assert widths.shape == (20, 2)
    np.testing.assert_allclose(widths, 0.7 * difficulties[:, None] * np.ones(2), atol=cell)
    np.testing.assert_allclose(widths[:, 0], widths[:, 1], atol=1e-3)
    # But for what the lowest ground lies below the plane.
    assert (np.diff(widths, axis=0) > -0.1 * cell).all()
    assert (widths[-1] > widths[0] + 3.0 * cell).all()


def test_a_seed_decides(robot: Robot) -> None:
    for name in ("roughness", "planks", "mixed"):
        one, same, other = (make_terrain(name, robot, seed=seed) for seed in (3, 3, 4))
        np.testing.assert_array_equal(one.grid.elevation, same.grid.elevation)
        assert (one.grid.elevation != other.grid.elevation).any()


def test_levels_lie_side_by_side_from_level_to_hardest() -> None:
    robot = load("go1")
    every = make_terrain("mixed", robot, difficulty=None, seed=5)
    assert every.tiles.number == NUM_LEVELS
    starts = every.starts.reshape(NUM_LEVELS, -1, 2)
    for level in (0, 4, 10):
        alone = make_terrain("mixed", robot, difficulty=level / (NUM_LEVELS - 1), seed=5)
        shift = level * alone.tiles.edge
        np.testing.assert_allclose(starts[level], alone.starts + [shift, 0.0])
        x, y = spread(alone, 101)
        np.testing.assert_allclose(every.height(x + shift, y), alone.height(x, y), atol=1e-9)
        inside = np.full(len(alone.starts), level)
        assert not every.tiles.left(inside, starts[level]).any()
        assert every.tiles.left(inside + 1, starts[level]).all()


def test_the_kind_of_ground_is_known_everywhere() -> None:
    """All five are where robots start: the nine inner patches of a tile have their tops."""
    robot, names = load("go1"), LEVELLED[:-1]
    every = make_terrain("mixed", robot, difficulty=None, seed=0)
    alone = [make_terrain(name, robot, difficulty=1.0) for name in names]
    tops = [float(kind.height(*kind.starts[4])) for kind in alone]
    hardest = every.starts[-9:]
    kinds = every.tiles.kind(hardest)
    assert set(kinds) == set(range(len(names)))
    height = every.height(*hardest.T)
    np.testing.assert_allclose(height, np.take(tops, kinds), atol=1e-9)
    # All over a patch, and alike on all tiles.
    patch = every.tiles.edge / 5
    for x, y in 0.49 * patch * np.array([(1, 1), (-1, 1), (1, -1), (-1, -1)]):
        np.testing.assert_array_equal(every.tiles.kind(hardest + [x, y]), kinds)
    np.testing.assert_array_equal(every.tiles.kind(every.starts[:9]), kinds)
    for k, one in enumerate(alone):
        assert (one.tiles.kind(one.starts) == k).all()


def test_the_size_of_the_robot_decides() -> None:
    small, large = (make_terrain("stairs", load(name)) for name in ("go1", "quadruped"))
    ratio = large.tiles.edge / small.tiles.edge
    assert abs(ratio - 1.0) > 0.05
    np.testing.assert_allclose(large.grid.cell, ratio * small.grid.cell)
    # What lies below the plane, to leave the ground to it, does so by the same for all.
    above = small.grid.elevation > 0.0
    np.testing.assert_allclose(large.grid.elevation[above], ratio * small.grid.elevation[above])
