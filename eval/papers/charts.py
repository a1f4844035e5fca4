"""Charts of the papers' page: curves over time, and bars."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from eval.papers.log import Log
from eval.plots import Marks, Scale, Series, panel, ticks
from eval.wording import number

_POINTS = 260
_BAR, _GAP, _GROUP = 11.0, 2.0, 12.0
_WIDTH, _LEFT, _RIGHT = 400.0, 96.0, 44.0


def thinned(x: np.ndarray, y: np.ndarray, points: int = _POINTS) -> tuple[list[float], list[float]]:
    """At most `points` samples of a curve that keep its extremes, so that no spike is lost.

    Args:
        x: (T,) ascending.
        y: (T,), NaN where there is nothing.
        points: how many to keep.
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    known = np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) <= points:
        return x.tolist(), y.tolist()
    edges = np.linspace(0, len(x), points // 2 + 1).astype(int)
    kept = sorted(
        {
            low + int(pick(y[low:high]))
            for low, high in zip(edges[:-1], edges[1:], strict=True)
            for pick in (np.argmin, np.argmax)
        }
    )
    return x[kept].tolist(), y[kept].tolist()


def traces(
    time: np.ndarray,
    curves: Sequence[tuple[str, int, np.ndarray]],
    title: str,
    unit_time: str = "s",
    y_range: tuple[float, float] | None = None,
) -> str:
    """Curves over time.

    Args:
        time: (T,).
        curves: (name, colour, (T,) values) each; those without any finite value are left out.
        title: what is shown, with its unit.
        unit_time: of the horizontal axis.
        y_range: of the vertical axis; None for what the data need.
    """
    series = []
    for name, colour, values in curves:
        x, y = thinned(time, values)
        if x:
            series.append(Series(name, colour, x, y))
    return panel(series, title, unit_time, y_range=y_range)


def logged(
    curves: Sequence[tuple[str, int, Log, np.ndarray]],
    title: str,
    since: float = -np.inf,
    until: float = np.inf,
) -> str:
    """Curves over time of the first robots of logs, each up to its robot's fall.

    Args:
        curves: (name, colour, log, (T,) values at the log's ticks) each.
        title: what is shown, with its unit.
        since: s, where the chart begins.
        until: s, where it ends.
    """
    longest = max((log for _, _, log, _ in curves), key=lambda log: len(log.time)).time
    shown = (longest > since) & (longest < until)
    padded = []
    for name, colour, log, values in curves:
        up = np.where(log.up[:, 0], values, np.nan)
        padded.append((name, colour, np.append(up, np.full(len(longest) - len(up), np.nan))[shown]))
    return traces(longest[shown], padded, title)


def lines(
    x: Sequence[float],
    curves: Sequence[tuple[str, int, Sequence[float]]],
    title: str,
    x_title: str,
    y_range: tuple[float, float] | None = None,
    y_format: Callable[[float], str] = number,
    threshold: float | None = None,
) -> str:
    """Curves of a sweep, with a dot at each value; values that are not finite are left out."""
    series = []
    for name, colour, values in curves:
        points = [(a, b) for a, b in zip(x, values, strict=True) if np.isfinite(b)]
        if points:
            series.append(
                Series(name, colour, [a for a, _ in points], [b for _, b in points], dots=True)
            )
    marks = Marks(threshold)
    return panel(series, title, x_title, y_range=y_range, y_format=y_format, marks=marks)


@dataclass(frozen=True)
class Bars:
    """One colour of a bar chart: a value for each group, NaN for none."""

    name: str
    colour: int
    values: Sequence[float]


def bars(
    groups: Sequence[str],
    series: Sequence[Bars],
    title: str,
    form: Callable[[float], str] = number,
    top: float | None = None,
) -> str:
    """Horizontal bars, grouped, with their values at their ends.

    Args:
        groups: names, from top to bottom.
        series: one bar in every group each.
        title: what is shown, with its unit.
        form: of the values.
        top: end of the axis; longer bars are cut there and carry their value. None: the longest.
    """
    values = [v for item in series for v in item.values if np.isfinite(v)]
    high = top if top is not None else max([*values, 1e-12])
    x = Scale(0.0, high, _LEFT, _WIDTH - _RIGHT)
    head = 26.0 + 14.0 * len(series)
    step = len(series) * (_BAR + _GAP) + _GROUP
    height = head + step * len(groups) + 18.0
    bottom = head + step * len(groups) - _GROUP / 2
    parts = [f'<text class="title" x="0" y="12">{escape(title)}</text>']
    for k, item in enumerate(series):
        y = 28.0 + 14.0 * k
        parts.append(
            f'<g class="c{item.colour}"><path class="line" d="M{_LEFT:.0f} {y - 4:.0f}h14" '
            f'style="stroke-width:8;stroke-linecap:butt"/>'
            f'<text class="name" x="{_LEFT + 20:.0f}" y="{y:.0f}">{escape(item.name)}</text></g>'
        )
    for value in ticks(0.0, high, 4):
        at = x(value)
        parts.append(f'<path class="grid" d="M{at:.1f} {head:.1f}V{bottom:.1f}"/>')
        parts.append(
            f'<text class="tick" x="{at:.1f}" y="{bottom + 14:.1f}" text-anchor="middle">'
            f"{escape(form(value))}</text>"
        )
    for row, group in enumerate(groups):
        y = head + row * step + 4.0
        middle = y + (step - _GROUP) / 2 + 3.0
        parts.append(
            f'<text class="tick" x="{_LEFT - 8:.0f}" y="{middle:.1f}" text-anchor="end">'
            f"{escape(group)}</text>"
        )
        for item in series:
            value = item.values[row]
            if np.isfinite(value):
                end = x(min(value, high))
                parts.append(
                    f'<g class="c{item.colour}"><path class="line" style="stroke-width:{_BAR};'
                    f'stroke-linecap:butt" d="M{x.start:.1f} {y + _BAR / 2:.1f}H{end:.1f}"/></g>'
                    f'<text class="tick" x="{end + 4:.1f}" y="{y + _BAR - 2:.1f}">'
                    f"{escape(form(value))}</text>"
                )
            y += _BAR + _GAP
    label = f"{title}: {', '.join(item.name for item in series)}"
    return (
        f'<svg viewBox="0 0 {_WIDTH:.0f} {height:.0f}" role="img" '
        f'aria-label="{escape(label)}">{"".join(parts)}</svg>'
    )
