"""The report's figures as inline SVG.

Written by hand rather than by a plotting library so that they take their colours from the page's
style (light or dark), scale to a phone, carry their values as tooltips, and need nothing from
outside the page. Classes `c0`, `c1`, ... set the colour of a layer; everything else is in the
style sheet of `report`.
"""

import math
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

import numpy as np

from eval.wording import number

WIDTH, HEIGHT = 400.0, 270.0
STRIP_WIDTH = 300.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 40.0, 106.0, 26.0, 36.0
_LINE = 13.0
_GAP = 90.0  # between the panels of a sheet: long names reach into it


@dataclass(frozen=True)
class Series:
    """One layer in a panel."""

    name: str
    colour: int
    x: Sequence[float]
    value: Sequence[float]
    low: Sequence[float] | None = None
    high: Sequence[float] | None = None
    singles: Sequence[tuple[Sequence[float], Sequence[float]]] = field(default=())
    """Curves of single runs, drawn thin."""
    level: float | None = None
    """A level to compare with, drawn dashed: what the zero action earns."""
    dashed: Sequence[float] | None = None
    """A curve to compare with on the same abscissae, drawn dashed."""
    dots: bool = False
    """Mark the points of the curve."""


@dataclass(frozen=True)
class Marks:
    """What else a panel shows; None: nothing."""

    threshold: float | None = None
    """Level drawn across the panel."""
    shaded_to: float | None = None
    """Shade the abscissae up to here."""
    upright: float | None = None
    """Abscissa of an upright line."""


@dataclass(frozen=True)
class Scale:
    """A linear map from data to page."""

    low: float
    high: float
    start: float
    stop: float

    def __call__(self, value: float) -> float:
        """Map one value."""
        share = (value - self.low) / (self.high - self.low)
        return self.start + share * (self.stop - self.start)


def ticks(low: float, high: float, count: int = 5) -> list[float]:
    """Round numbers within [low, high], about `count` of them: steps of 1, 2 or 5 times 10^k."""
    raw = (high - low) / count
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= raw - 1e-12 * raw)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def spread(
    positions: Sequence[float], gaps: Sequence[float], low: float, high: float
) -> list[float]:
    """Move label centres apart until none overlaps, as little as possible and within [low, high].

    Args:
        positions: wanted centres.
        gaps: height of each label.
        low: upper edge of the space, as y grows downwards.
        high: lower edge.
    """
    order = sorted(range(len(positions)), key=lambda i: positions[i])
    placed = list(positions)
    for _ in range(200):
        for i, j in zip(order, order[1:], strict=False):
            overlap = (gaps[i] + gaps[j]) / 2 - (placed[j] - placed[i])
            if overlap > 0:
                placed[i] -= overlap / 2
                placed[j] += overlap / 2
        placed = [
            min(max(y, low + gap / 2), high - gap / 2) for y, gap in zip(placed, gaps, strict=True)
        ]
    return placed


def panel(
    series: Sequence[Series],
    title: str,
    x_title: str,
    x_format: Callable[[float], str] = number,
    y_format: Callable[[float], str] = number,
    x_range: tuple[float, float] | None = None,
    y_range: tuple[float, float] | None = None,
    marks: Marks = Marks(),
) -> str:
    """Lines with bands, labelled at their ends.

    Args:
        series: one per layer.
        title: what the vertical axis shows; stands above it.
        x_title: what the horizontal axis shows.
        x_format: of tick labels.
        y_format: of tick labels.
        x_range: of the horizontal axis. None: what the data need, and zero.
        y_range: of the vertical axis. None: what the data need.
        marks: what else there is.
    """
    if x_range is None:
        x_values = [x for item in series for x in item.x]
        x_values += [x for item in series for single in item.singles for x in single[0]]
        x_range = min(0.0, *x_values), max(x_values)
    x = _axis(*x_range, _LEFT, WIDTH - _RIGHT, padding=0.0)
    if y_range is None:
        y_range = _extent(series, marks.threshold)
    y = Scale(*y_range, HEIGHT - _BOTTOM, _TOP)
    parts = [_frame(x, y, title, x_title, x_format, y_format)]
    if marks.shaded_to is not None:
        right = x(min(marks.shaded_to, x.high))
        parts.insert(
            0,
            f'<rect class="shade" x="{x.start:.1f}" y="{_TOP}" width="{right - x.start:.1f}" '
            f'height="{HEIGHT - _TOP - _BOTTOM:.1f}"/>',
        )
    if marks.upright is not None:
        at = f"M{x(marks.upright):.1f} {y.start:.1f}V{y.stop:.1f}"
        parts.append(f'<path class="threshold" d="{at}"/>')
    if marks.threshold is not None:
        parts.append(_threshold(marks.threshold, x, y))
    parts += [_series(item, x, y) for item in series]
    parts.append(_end_labels(series, x, y))
    return _svg(parts, HEIGHT, f"{title} against {x_title}: {', '.join(s.name for s in series)}")


def _series(item: Series, x: Scale, y: Scale) -> str:
    parts = [f'<g class="c{item.colour}">']
    if item.low is not None and item.high is not None and len(item.x) > 1:
        upper = [(x(a), y(b)) for a, b in zip(item.x, item.high, strict=True)]
        lower = [(x(a), y(b)) for a, b in zip(item.x, item.low, strict=True)]
        parts.append(f'<path class="band" d="{_path(upper + lower[::-1])}Z"/>')
    if item.level is not None:
        parts.append(
            f'<path class="dashed" d="M{x.start:.1f} {y(item.level):.1f}H{x.stop:.1f}">'
            f"<title>{escape(item.name)}, zero action: {number(item.level)}</title></path>"
        )
    if item.dashed is not None:
        points = [(x(a), y(b)) for a, b in zip(item.x, item.dashed, strict=True)]
        parts.append(
            f'<path class="dashed" d="{_path(points)}">'
            f"<title>{escape(item.name)}, zero action</title></path>"
        )
    for xs, ys in item.singles:
        points = [(x(a), y(b)) for a, b in zip(xs, ys, strict=True)]
        parts.append(f'<path class="single" d="{_path(points)}"/>')
    points = [(x(a), y(b)) for a, b in zip(item.x, item.value, strict=True)]
    parts.append(
        f'<path class="line" d="{_path(points)}"><title>{escape(item.name)}</title></path>'
    )
    if item.dots or len(points) == 1:
        parts += [f'<circle class="dot" cx="{a:.1f}" cy="{b:.1f}" r="3"/>' for a, b in points]
    return "".join(parts) + "</g>"


def _frame(
    x: Scale,
    y: Scale,
    title: str,
    x_title: str,
    x_format: Callable[[float], str],
    y_format: Callable[[float], str],
) -> str:
    bottom = HEIGHT - _BOTTOM
    parts = [f'<text class="title" x="0" y="12">{escape(title)}</text>']
    for value in ticks(y.low, y.high):
        at = y(value)
        parts.append(f'<path class="grid" d="M{x.start:.1f} {at:.1f}H{x.stop:.1f}"/>')
        parts.append(
            f'<text class="tick" x="{_LEFT - 6}" y="{at + 4:.1f}" text-anchor="end">'
            f"{escape(y_format(value))}</text>"
        )
    parts.append(f'<path class="axis" d="M{x.start:.1f} {bottom:.1f}H{x.stop:.1f}"/>')
    for value in ticks(x.low, x.high, 4):
        parts.append(f'<path class="axis" d="M{x(value):.1f} {bottom:.1f}v4"/>')
        parts.append(
            f'<text class="tick" x="{x(value):.1f}" y="{bottom + 16:.1f}" text-anchor="middle">'
            f"{escape(x_format(value))}</text>"
        )
    parts.append(
        f'<text class="tick" x="{x.stop:.1f}" y="{HEIGHT - 3}" text-anchor="end">'
        f"{escape(x_title)}</text>"
    )
    return "".join(parts)


def _threshold(threshold: float, x: Scale, y: Scale) -> str:
    at = y(threshold)
    return (
        f'<path class="threshold" d="M{x.start:.1f} {at:.1f}H{x.stop:.1f}"/>'
        f'<text class="note" x="{x.start + 4:.1f}" y="{at - 4:.1f}">'
        f"threshold {number(threshold)}</text>"
    )


def _end_labels(series: Sequence[Series], x: Scale, y: Scale) -> str:
    words = [item.name.replace("_", " ") for item in series]  # where lines may break
    lines = [textwrap.wrap(name, 17, break_long_words=False) for name in words]
    top, bottom, apart = _TOP - 10, HEIGHT - _BOTTOM + 4, 3.0
    if _LINE * sum(map(len, lines)) + apart * len(lines) > bottom - top:  # crowded
        bottom, apart = HEIGHT - 6, 0.0
    gaps = [_LINE * len(text) + apart for text in lines]
    lefts = [x(item.x[-1]) + 6 for item in series]
    wanted = [y(item.value[-1]) for item in series]
    centres = dict.fromkeys(range(len(series)), 0.0)
    for column in _columns(lefts):
        own = [wanted[i] for i in column], [gaps[i] for i in column]
        placed = spread(*own, top, bottom)
        centres.update(zip(column, placed, strict=True))
    parts = []
    for item, text, left, centre in zip(series, lines, lefts, centres.values(), strict=True):
        first = centre - _LINE * (len(text) - 1) / 2 + 4
        spans = "".join(
            f'<tspan x="{left:.1f}" y="{first + _LINE * k:.1f}">{escape(line)}</tspan>'
            for k, line in enumerate(text)
        )
        parts.append(f'<text class="name c{item.colour}">{spans}</text>')
    return "".join(parts)


def _columns(lefts: Sequence[float]) -> list[list[int]]:
    """Return which labels may be in each other's way: those not a label's width apart."""
    columns: list[list[int]] = []
    for i in sorted(range(len(lefts)), key=lambda i: lefts[i]):
        if columns and lefts[i] - lefts[columns[-1][-1]] < _RIGHT:
            columns[-1].append(i)
        else:
            columns.append([i])
    return columns


@dataclass(frozen=True)
class Strip:
    """One layer in a strip plot."""

    name: str
    colour: int
    values: Sequence[float]
    """One per run."""
    value: float
    low: float | None
    high: float | None
    zero_action: float


def strips(
    rows: Sequence[Strip],
    title: str,
    form: Callable[[float], str] = number,
    limits: tuple[float, float] | None = None,
) -> str:
    """One metric: a row per layer with every run, their interquartile mean and its interval.

    Args:
        rows: one per layer.
        title: the metric and its unit.
        form: of numbers.
        limits: the axis goes no further than this, such as (0, 1) for a share.
    """
    row_height, top = 36.0, 34.0
    height = top + row_height * len(rows) + 16
    everything = [v for row in rows for v in (*row.values, row.zero_action, row.low, row.high)]
    finite = [v for v in everything if v is not None and math.isfinite(v)]
    x = _axis(min(finite), max(finite), 6.0, STRIP_WIDTH - 60.0, limits=limits)
    bottom = top + row_height * len(rows)
    parts = [f'<text class="title" x="0" y="12">{escape(title)}</text>']
    low, high = (
        (x.low, x.high) if limits is None else (max(x.low, limits[0]), min(x.high, limits[1]))
    )
    for value in ticks(low, high, 4):
        parts.append(f'<path class="grid" d="M{x(value):.1f} {top - 8}V{bottom:.1f}"/>')
        parts.append(
            f'<text class="tick" x="{x(value):.1f}" y="{bottom + 14:.1f}" text-anchor="middle">'
            f"{escape(form(value))}</text>"
        )
    for k, row in enumerate(rows):
        parts.append(_strip(row, x, top + row_height * k, form))
    label = f"{title}: {', '.join(row.name for row in rows)}"
    return _svg(parts, height, label, STRIP_WIDTH)


def _strip(row: Strip, x: Scale, top: float, form: Callable[[float], str]) -> str:
    at = top + 17
    parts = [
        f'<g class="c{row.colour}">',
        f'<text class="name" x="6" y="{top + 4:.1f}">{escape(row.name)}</text>',
        f'<text class="value" x="{STRIP_WIDTH}" y="{at + 4:.1f}" text-anchor="end">'
        f"{escape(form(row.value))}</text>",
    ]
    if row.low is not None and row.high is not None:
        parts.append(
            f'<path class="interval" d="M{x(row.low):.1f} {at:.1f}H{x(row.high):.1f}">'
            f"<title>{form(row.low)} to {form(row.high)}</title></path>"
        )
    if math.isfinite(row.zero_action):
        centre = x(row.zero_action)
        parts.append(
            f'<path class="diamond" d="M{centre:.1f} {at - 5:.1f}l5 5l-5 5l-5 -5Z">'
            f"<title>zero action: {form(row.zero_action)}</title></path>"
        )
    for value in row.values:
        if math.isfinite(value):
            parts.append(
                f'<circle class="dot" cx="{x(value):.1f}" cy="{at:.1f}" r="3.5">'
                f"<title>{form(value)}</title></circle>"
            )
    if math.isfinite(row.value):
        parts.append(f'<path class="mean" d="M{x(row.value):.1f} {at - 8:.1f}v16"/>')
    return "".join(parts) + "</g>"


def _axis(
    low: float,
    high: float,
    start: float,
    stop: float,
    padding: float = 0.06,
    limits: tuple[float, float] | None = None,
) -> Scale:
    """Scale over the data with some room at both ends."""
    width = high - low
    if width <= 1e-9 * max(abs(low), abs(high), 1e-6):  # all alike: show it in the middle
        width = max(abs(low), 1.0) * 0.1
        low, high = low - width / 2, high + width / 2
    low, high = low - padding * width, high + padding * width
    if limits is not None:
        room = padding * (limits[1] - limits[0])
        low, high = max(low, limits[0] - room), min(high, limits[1] + room)
    return Scale(low, high, start, stop)


def _extent(series: Sequence[Series], threshold: float | None) -> tuple[float, float]:
    values: list[float] = [] if threshold is None else [threshold]
    for item in series:
        for part in (item.value, item.low or (), item.high or (), item.dashed or ()):
            values += part
        values += [v for single in item.singles for v in single[1]]
        values += [] if item.level is None else [item.level]
    finite = np.array([value for value in values if math.isfinite(value)])
    scale = _axis(float(finite.min()), float(finite.max()), 0.0, 1.0)
    low = 0.0 if 0 <= finite.min() and scale.low < 0 else scale.low
    return low, scale.high


def _path(points: Sequence[tuple[float, float]]) -> str:
    return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in points)


def _svg(parts: Sequence[str], height: float, label: str, width: float = WIDTH) -> str:
    return (
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" role="img" '
        f'aria-label="{escape(label)}">{"".join(parts)}</svg>'
    )


def sheet(panels: Sequence[str], columns: int = 2) -> str:
    """Return panels side by side as one SVG file, which brings its style along."""
    style = (Path(__file__).parent / "style.css").read_text()
    across, down = WIDTH + _GAP, HEIGHT + _GAP
    width, height = columns * across, -(-len(panels) // columns) * down
    placed = []
    for index, part in enumerate(panels):
        x, y = across * (index % columns) + 0.1 * _GAP, down * (index // columns) + 0.5 * _GAP
        where = f'x="{x:.0f}" y="{y:.0f}" width="{WIDTH:.0f}" height="{HEIGHT:.0f}"'
        placed.append(part.replace("<svg ", f"<svg {where} ", 1))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}">'
        f"<style>{style} svg {{ width: auto; }}</style>"
        f'<rect width="100%" height="100%" style="fill: var(--paper)"/>{"".join(placed)}</svg>\n'
    )
