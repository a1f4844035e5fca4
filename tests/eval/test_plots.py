"""Axes, labels and marks of the report's figures."""

import re

import numpy as np
import pytest

from eval.plots import Scale, Series, Strip, panel, spread, strips, ticks


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0, 1, [0, 0.2, 0.4, 0.6, 0.8, 1.0]),
        (-3, 97, [0, 20, 40, 60, 80]),
        (240.0, 287.0, [240, 250, 260, 270, 280]),
        (0.0121, 0.0139, [0.0125, 0.013, 0.0135]),
    ],
)
def test_ticks_are_round(low: float, high: float, expected: list[float]) -> None:
    np.testing.assert_allclose(ticks(low, high), expected)


def test_ticks_lie_within_for_any_range(rng: np.random.Generator) -> None:
    for _ in range(300):
        low = rng.normal() * 10.0 ** rng.integers(-6, 7)
        high = low + 10.0 ** rng.uniform(-4, 7)
        values = ticks(low, high)
        assert 2 <= len(values) <= 7
        margin = 1e-6 * (high - low)
        assert all(low - margin <= value <= high + margin for value in values)
        np.testing.assert_allclose(np.diff(values), np.diff(values)[0])


def test_labels_are_moved_apart_and_stay_in_order(rng: np.random.Generator) -> None:
    for _ in range(100):
        wanted = rng.uniform(20, 180, size=5).tolist()
        placed = spread(wanted, [16.0] * 5, 0.0, 200.0)
        order = np.argsort(wanted)
        gaps = np.diff(np.array(placed)[order])
        assert gaps.min() > 15.5
        assert min(placed) >= 8 and max(placed) <= 192
    assert spread([50.0, 120.0], [16.0, 16.0], 0, 200) == [50.0, 120.0]


def test_labels_at_other_ends_do_not_move_each_other() -> None:
    """Curves of a fifth of the steps end beside others: only the labels of each end make room."""

    def heights(*ends: float) -> list[float]:
        series = [Series("layer", 1, [0.0, end], [10.0, 3.0]) for end in (*ends, 100.0)]
        svg = panel(series, "Error", "steps")
        return [float(y) for y in re.findall(r'<tspan x="[^"]+" y="([^"]+)"', svg)]

    (alone,) = heights()
    *three, last = heights(20.0, 20.0, 20.0)
    assert last == alone and min(np.diff(sorted(three))) > 12.0
    assert min(np.diff(sorted(heights(99.0, 99.0, 99.0)))) > 12.0


def test_scale_maps_ends_to_ends() -> None:
    scale = Scale(2.0, 4.0, 100.0, 0.0)
    assert [scale(value) for value in (2.0, 3.0, 4.0)] == [100.0, 50.0, 0.0]


def numbers(path: str) -> np.ndarray:
    return np.array([float(value) for value in re.findall(r"-?\d+\.?\d*", path)]).reshape(-1, 2)


def test_a_line_goes_through_its_points() -> None:
    x, y = [0.0, 50.0, 100.0], [0.0, 30.0, 40.0]
    svg = panel([Series("one layer", 2, x, y, [0, 20, 30], [10, 35, 41])], "Return", "steps")
    (line,) = re.findall(r'class="line" d="([^"]+)"', svg)
    points = numbers(line)
    spacing = np.diff(points, axis=0)
    assert spacing[0, 0] == pytest.approx(spacing[1, 0], abs=0.2)
    assert spacing[0, 1] / spacing[1, 1] == pytest.approx(3.0, abs=0.1)
    assert spacing[0, 1] < 0  # up the page
    assert 'class="c2"' in svg and "one layer" in svg
    (band,) = re.findall(r'class="band" d="([^"]+)"', svg)
    assert len(numbers(band)) == 6


def test_marks_of_a_strip(rng: np.random.Generator) -> None:
    row = Strip("x", 0, [1.0, 2.0, 3.0], 2.0, 1.0, 3.0, 0.0)
    svg = strips([row, row], "Metric, unit")
    assert svg.count('class="dot"') == 6 and svg.count('class="diamond"') == 2
    assert svg.count('class="interval"') == svg.count('class="mean"') == 2
    single = strips([Strip("x", 0, [1.0], 1.0, None, None, float("nan"))], "Metric")
    assert "interval" not in single and "diamond" not in single and "nan" not in single


@pytest.mark.parametrize("value", [0.0, 5.0, -3.0, 1e-9])
def test_alike_values_still_make_a_figure(value: float) -> None:
    assert "nan" not in strips([Strip("x", 0, [value], value, None, None, value)], "Metric")
    svg = panel([Series("x", 0, [0.0, 1.0], [value, value])], "Return", "steps")
    assert "nan" not in svg and "inf" not in svg
    point = panel([Series("x", 0, [0.0], [value])], "Return", "steps")
    assert 'class="dot"' in point
