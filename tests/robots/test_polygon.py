"""Hulls against scipy's, few corners against what they leave out, margins against sampling."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from fbid_gym.robots.polygon import convex_hull, few_corners, margin_within


@pytest.mark.parametrize("count", [4, 7, 30, 300])
def test_the_hull_is_scipys(rng: np.random.Generator, count: int) -> None:
    points = rng.normal(size=(count, 2))
    expected = ConvexHull(points).vertices
    assert set(convex_hull(points)) <= set(expected.tolist())  # but for corners that hardly are
    corners = points[convex_hull(points)]
    ahead = np.roll(corners, -1, axis=0)
    area = 0.5 * np.sum(corners[:, 0] * ahead[:, 1] - corners[:, 1] * ahead[:, 0])
    assert area == pytest.approx(ConvexHull(points).volume, rel=2e-3)  # positive: counterclockwise


def test_rows_of_points_level_but_for_rounding(rng: np.random.Generator) -> None:
    """Soles side by side: their outer corners are the hull, however the rows are rounded."""
    x, y = np.meshgrid([-0.3, -0.2, 0.0, 0.1, 0.3, 0.4], [-0.2, -0.1, 0.1, 0.2])
    exact = np.column_stack([x.ravel(), y.ravel()])
    for _ in range(50):
        points = exact + rng.normal(size=exact.shape) * 1e-9
        corners = points[convex_hull(points)]
        assert ConvexHull(corners).volume == pytest.approx(0.7 * 0.4)


def test_hulls_without_an_area() -> None:
    assert convex_hull(np.array([[1.0, 2.0]])) == [0]
    assert convex_hull(np.array([[1.0, 2.0]] * 3)) in ([0], [1], [2])
    line = np.array([[0.0, 0.0], [3.0, 3.0], [1.0, 1.0], [2.0, 2.0]])
    assert sorted(convex_hull(line)) == [0, 1]


def test_few_corners_span_almost_all_of_the_area(rng: np.random.Generator) -> None:
    for _ in range(50):
        angle = rng.uniform(0.0, 2.0 * np.pi, 40)
        points = np.column_stack([np.cos(angle), 0.4 * np.sin(angle)])
        corners = few_corners(points)
        assert 4 <= len(corners) <= 8
        whole, kept = ConvexHull(points).volume, ConvexHull(points[corners]).volume
        assert kept > 0.85 * whole


def test_a_rectangle_keeps_its_corners_whatever_lies_between(rng: np.random.Generator) -> None:
    corners = np.array([[-1.0, -2.0], [1.0, -2.0], [1.0, 2.0], [-1.0, 2.0]])
    points = np.concatenate([rng.uniform([-1.0, -2.0], [1.0, 2.0], (50, 2)), corners])
    assert set(few_corners(points)) == {50, 51, 52, 53}


def test_margins_are_distances_to_the_border(rng: np.random.Generator) -> None:
    points = rng.normal(size=(9, 2))
    corners = points[convex_hull(points)]
    along = np.linspace(0.0, 1.0, 2000)[:, None]
    edges = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    border = np.concatenate([a + along * (b - a) for a, b in edges])
    hull = ConvexHull(points).equations
    for place in rng.normal(size=(40, 2)):
        distance = np.linalg.norm(border - place, axis=1).min()
        if np.all(hull[:, :2] @ place + hull[:, 2] < 0.0):
            assert margin_within(points, place) == pytest.approx(distance, abs=1e-3)
        else:
            assert -distance - 1e-3 <= margin_within(points, place) <= 0.0


def test_margins_off_a_line_and_a_point() -> None:
    line = np.array([[0.0, 0.0], [2.0, 0.0]])
    assert margin_within(line, np.array([1.0, 0.5])) == pytest.approx(-0.5)
    assert margin_within(line, np.array([5.0, 4.0])) == pytest.approx(-5.0)
    assert margin_within(line[:1], np.array([3.0, 4.0])) == pytest.approx(-5.0)
