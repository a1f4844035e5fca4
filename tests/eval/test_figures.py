"""Figures take their colours from the page, name their curves beside the axes, and never break."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from eval.page.figures import HEIGHT, Series, Strip, apart, bars, lines, panel, polar, sheet, strips
from eval.results import Estimate
from train.episodes import Metric

METRIC = Metric("m", "metric", "unit", -1)
X, Y = [0.0, 50.0, 100.0], [0.0, 30.0, 40.0]


def curves_of(svg: str, colour: int) -> list[np.ndarray]:
    """The points of the curves in a colour."""
    drawn = re.findall(rf'<path d="([^"]+)"[^>]*style="fill: none; stroke: var\(--c{colour}\)', svg)
    return [np.array(re.findall(r"-?[\d.]+", path), float).reshape(-1, 2) for path in drawn]


def test_labels_are_moved_apart_stay_in_order_and_move_no_more_than_they_must(rng):
    for _ in range(100):
        wanted, heights = rng.uniform(20, 180, size=5), rng.uniform(8, 24, size=5)
        placed = apart(wanted, heights, 0.0, 200.0)
        order = np.argsort(wanted)
        half = heights[order] / 2
        assert (np.diff(placed[order]) > half[1:] + half[:-1] - 1e-9).all()
        assert (placed - heights / 2).min() > -1e-9 and (placed + heights / 2).max() < 200 + 1e-9
    np.testing.assert_allclose(apart([50.0, 120.0], [16.0, 16.0], 0, 200), [50.0, 120.0])
    np.testing.assert_allclose(apart([50.0, 50.0], [16.0, 16.0], 0, 200), [42.0, 58.0])


def test_a_line_goes_through_its_points_in_the_colour_of_the_page():
    svg = panel([Series("one layer", 2, X, Y, [0, 20, 30], [10, 35, 41])], "Return", "steps")
    (line,) = curves_of(svg, 2)
    across, up = np.diff(line, axis=0).T
    assert across[0] == pytest.approx(across[1], abs=0.2)
    assert up[0] / up[1] == pytest.approx(3.0, abs=0.1) and up[0] < 0  # up the page
    assert "<title>one layer</title>" in svg and "fill: var(--c2); fill-opacity: 0.14" in svg
    assert not re.search(r"#[0-9a-f]{6}[;\"]|font-family|https?:", svg)


def test_no_name_stands_in_the_axes():
    """Of curves that end early no more than of others."""
    early = Series("early", 1, X[:2], Y[:2])
    svg = panel([early, Series("late", 2, X, Y)], "Error", "steps")
    end = max(line[:, 0].max() for line in curves_of(svg, 2))
    for name in ("early", "late"):
        (x, y) = re.findall(rf'x="([\d.]+)" y="([\d.]+)"[^>]*>{name}</text>', svg)[0]
        assert float(x) > end and 0.0 < float(y) < HEIGHT


def test_a_panel_is_high_enough_for_all_names():
    svg = panel([Series(f"name {k:02d}", 1, X, Y) for k in range(30)], "Error", "steps")
    height = float(re.findall(r'viewBox="0 0 \S+ ([\d.]+)"', svg)[0])
    below = [float(y) for y in re.findall(r'y="([\d.]+)"[^>]*>name \d\d</text>', svg)]
    assert len(below) == 30 and max(below) < height - 30.0  # above the ticks
    assert f'height="{height:.0f}"' in sheet([svg])


def test_what_files_say_is_text(rng):
    evil = '<b x="1">$x$ & co'
    shown = "&lt;b x=&quot;1&quot;&gt;$x$ &amp; co"
    drawn = [
        panel([Series(evil, 0, X, Y)], evil, evil),
        strips([Strip(evil, 0, [1.0], Estimate(1.0), 0.0)], Metric("a", evil, "", 0)),
        bars([evil], [(evil, 0, [1.0])], evil),
        polar([0.0, 90.0], [(evil, 0, [1.0, 2.0])], evil, evil, {0.0: evil}, (0.0, 1.0, evil)),
    ]
    for svg in drawn:
        assert "<b" not in svg and shown in svg
        ElementTree.fromstring(sheet([svg]))


def test_alike_values_still_make_a_figure():
    for value in (0.0, -3.0, 1e-9):
        for svg in (
            strips([Strip("x", 0, [value], Estimate(value), value)], METRIC),
            panel([Series("x", 0, [0.0, 1.0], [value, value])], "Return", "steps"),
            panel([Series("x", 0, [0.0], [value])], "Return", "steps"),
            lines([1.0, 2.0], [("x", 0, [value, np.nan]), ("none", 1, [np.nan] * 2)], "A", "B"),
            lines([1.0, 2.0], [("none", 1, [np.nan] * 2)], "A", "B"),
        ):
            assert not re.search(r"\bnan\b|\binf\b", svg) and "none</text>" not in svg


def test_figures_of_a_page_share_no_ids():
    """What one refers to is its own, also where the other is hidden."""
    ids = [
        set(re.findall(r'id="([^"]+)"', panel([Series("x", 0, X, its, dots=True)], "A", "B")))
        for its in (Y, Y[::-1])
    ]
    assert ids[0] and not ids[0] & ids[1]
