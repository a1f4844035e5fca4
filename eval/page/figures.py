"""The figures of the pages: SVG by matplotlib that takes its colours from the page's style.

Every colour is a variable of `style.css`, so that a figure turns dark with its page; text stays
text, in the page's fonts; values are told by tooltips. A curve is named in the margin beside the
axes and nowhere in them, so that no name lies on a curve.
"""

import hashlib
import html
import math
import re
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator
from scipy.optimize import isotonic_regression

from eval.wording import number

STYLE = (Path(__file__).parent / "style.css").read_text()
WIDTH, HEIGHT = 400.0, 270.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 44.0, 118.0, 30.0, 36.0
_LINE, _GAP = 13.0, 24.0
_NAMES = ("paper", "ink", "soft", "faint", "rule", "wash", *(f"c{k}" for k in range(10)))
_COLOUR = {name: f"#0a0b{k:02x}" for k, name in enumerate(_NAMES)}
"""Matplotlib knows no variables of CSS: it draws with these, which are then replaced."""

Form = Callable[[float], str]
Values = Sequence[float] | np.ndarray

_STYLE: Any = {
    "svg.fonttype": "none", "svg.hashsalt": "fbid_gym", "path.simplify_threshold": 0.5,
    "axes.axisbelow": True, "axes.edgecolor": _COLOUR["faint"], "axes.facecolor": "none",
    "axes.grid": True, "axes.spines.left": False, "axes.spines.right": False,
    "axes.spines.top": False, "axes.titlecolor": _COLOUR["ink"], "axes.titlelocation": "left",
    "axes.titlesize": 12.5, "axes.titleweight": "bold", "font.size": 11,
    "grid.color": _COLOUR["rule"], "grid.linewidth": 1, "lines.linewidth": 2.2,
    "lines.solid_capstyle": "round",
    "text.color": _COLOUR["soft"], "text.parse_math": False, "xtick.color": _COLOUR["faint"],
    "xtick.labelcolor": _COLOUR["soft"], "ytick.labelcolor": _COLOUR["soft"],
    "ytick.left": False,
}  # fmt: skip


@dataclass(frozen=True)
class Series:
    """One curve with what belongs to it."""

    name: str
    colour: int
    x: Values
    value: Values
    """NaN where there is nothing."""
    low: Values | None = None
    high: Values | None = None
    singles: Sequence[tuple[Values, Values]] = field(default=())
    """Curves of single runs, drawn thin."""
    level: float | None = None
    """A level to compare with, drawn dashed: what the zero action earns."""
    dashed: Values | None = None
    """A curve to compare with on the same abscissae, drawn dashed."""
    dots: bool = False
    """Mark the points of the curve."""


@dataclass(frozen=True)
class Marks:
    """What else a panel shows; None: nothing."""

    threshold: float | None = None
    """Level drawn across the panel, and named in the margin."""
    shaded_to: float | None = None
    """Shade the abscissae up to here."""
    upright: float | None = None
    """Abscissa of an upright line."""
    logarithmic: bool = False
    """Whether the vertical axis is."""


def panel(
    series: Sequence[Series],
    title: str,
    x_title: str,
    x_format: Form = number,
    y_format: Form = number,
    x_range: tuple[float, float] | None = None,
    y_range: tuple[float, float] | None = None,
    marks: Marks = Marks(),
) -> Markup:
    """Lines with bands, named beside their ends.

    Args:
        series: one per curve; those without any finite value are left out.
        title: what the vertical axis shows; stands above it.
        x_title: what the horizontal axis shows.
        x_format: of tick labels.
        y_format: of tick labels.
        x_range: of the horizontal axis. None: what the data need, and zero.
        y_range: of the vertical axis. None: what the data need.
        marks: what else there is.
    """
    series = [item for item in series if np.isfinite(item.value).any()]
    label = f"{title} against {x_title}: {', '.join(item.name for item in series)}"
    with _axes(WIDTH, HEIGHT, label, (_LEFT, _RIGHT, _TOP, _BOTTOM)) as (axes, drawn):
        axes.set_title(title, x=-_LEFT / (WIDTH - _LEFT - _RIGHT))
        axes.set_xlabel(x_title, loc="right", color=_COLOUR["soft"])
        for item in series:
            _curve(axes, item)
        if marks.threshold is not None:
            axes.axhline(marks.threshold, color=_COLOUR["faint"], linewidth=1, linestyle=":")
        if marks.upright is not None:
            axes.axvline(marks.upright, color=_COLOUR["faint"], linewidth=1, linestyle=":")
        axes.grid(axis="x", visible=False)
        axes.margins(x=0.0, y=0.06)
        axes.autoscale()
        if marks.logarithmic:
            axes.set_yscale("log")
            axes.yaxis.set_major_locator(LogLocator(numticks=6))
            axes.minorticks_off()
        else:
            axes.yaxis.set_major_locator(_round(5))
        x_low, x_high = axes.get_xlim()
        axes.set_xlim(x_range or (min(0.0, x_low), x_high))
        low, high = axes.get_ylim()
        least = min((float(np.min(line.get_ydata())) for line in axes.lines), default=0.0)
        axes.set_ylim(y_range or (0.0 if low < 0.0 <= least else low, high))
        axes.xaxis.set_major_locator(_round(4))
        axes.xaxis.set_major_formatter(_ticks(x_format))
        axes.yaxis.set_major_formatter(_ticks(y_format))
        if marks.shaded_to is not None:
            end = min(marks.shaded_to, axes.get_xlim()[1])
            axes.axvspan(axes.get_xlim()[0], end, color=_COLOUR["wash"], zorder=0, linewidth=0)
        _name_ends(axes, series, marks.threshold)
    return drawn[0]


def _curve(axes: Axes, item: Series) -> None:
    colour = _COLOUR[f"c{item.colour}"]
    dashed: Any = {"color": colour, "linewidth": 1.3, "linestyle": (0, (4, 3)), "alpha": 0.8}
    if item.low is not None and item.high is not None and len(item.x) > 1:
        axes.fill_between(item.x, item.low, item.high, color=colour, alpha=0.14, linewidth=0)
    if item.level is not None:
        told = f"{item.name}, zero action: {number(item.level)}"
        axes.axhline(item.level, gid=_told(told), **dashed)
    if item.dashed is not None:
        axes.plot(item.x, item.dashed, gid=_told(f"{item.name}, zero action"), **dashed)
    for x, y in item.singles:
        axes.plot(x, y, color=colour, linewidth=0.9, alpha=0.55)
    dots = item.dots or np.isfinite(item.value).sum() == 1
    axes.plot(item.x, item.value, color=colour, gid=_told(item.name), marker="o" if dots else "",
              markersize=5.5, markeredgecolor=_COLOUR["paper"], clip_on=not dots)  # fmt: skip


def _name_ends(axes: Axes, series: Sequence[Series], threshold: float | None) -> None:
    """Write names into the margin, as near to the ends of their curves as others leave room."""
    named = [(item.name.replace("_", " "), f"c{item.colour}", _last(item)) for item in series]
    if threshold is not None:
        named.append((f"threshold {number(threshold)}", "faint", threshold))
    scale = axes.get_position().height * HEIGHT
    wrapped = [textwrap.wrap(name, 18, break_long_words=False) or [""] for name, _, _ in named]
    heights = [_LINE * len(lines) + 3.0 for lines in wrapped]
    at = axes.transAxes.inverted().transform(axes.transData.transform([(0, y) for *_, y in named]))
    centres = apart(scale * (1.0 - at[:, 1]), heights, -10.0, scale + _BOTTOM - 8.0)
    for (_, colour, _), lines, centre in zip(named, wrapped, centres, strict=True):
        for k, line in enumerate(lines):
            below = centre + _LINE * (k - 0.5 * (len(lines) - 1))
            axes.annotate(line, (1.0, 1.0), (6.0, -below), xycoords="axes fraction",
                          textcoords="offset points", va="center_baseline",
                          color=_COLOUR[colour], weight="bold")  # fmt: skip


def _last(item: Series) -> float:
    values = np.asarray(item.value, float)
    return float(values[np.isfinite(values)][-1])


def apart(
    wanted: Sequence[float] | np.ndarray, heights: Sequence[float], low: float, high: float
) -> np.ndarray:
    """Move the centres of labels apart until none overlaps, as little as possible.

    Args:
        wanted: (N,) centres.
        heights: (N,) of the labels.
        low: edge that no label crosses.
        high: the other; where there are too many labels, they cross this one.
    """
    order = np.argsort(wanted, kind="stable")
    half = np.asarray(heights, float)[order] / 2.0
    below = np.concatenate([[0.0], np.cumsum(half[:-1] + half[1:])])  # the first label
    first = isotonic_regression(np.asarray(wanted, float)[order] - below).x
    top = low + half[0]
    placed = np.empty(len(order))
    placed[order] = np.clip(first, top, max(top, high - half[-1] - below[-1])) + below
    return placed


def lines(
    x: Values,
    named: Sequence[tuple[str, int, Values]],
    title: str,
    x_title: str = "s",
    y_range: tuple[float, float] | None = None,
    y_format: Form = number,
    marks: Marks = Marks(),
    dots: bool = True,
) -> Markup:
    """Curves of (name, colour, values) on common abscissae, as a panel; NaN for no value."""
    series = [Series(name, colour, x, values, dots=dots) for name, colour, values in named]
    span = (float(np.min(x)), float(np.max(x))) if len(x) > 1 else None
    return panel(series, title, x_title, number, y_format, span, y_range, marks)


def traces(
    time: np.ndarray, named: Sequence[tuple[str, int, np.ndarray]], title: str, x_title: str = "s"
) -> Markup:
    """Curves over time, as a panel."""
    return lines(time, named, title, x_title, dots=False)


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
    form: Form = number,
    limits: tuple[float, float] | None = None,
) -> Markup:
    """One metric: a row per layer with every run, their interquartile mean and its interval.

    Args:
        rows: one per layer.
        title: the metric and its unit.
        form: of numbers.
        limits: the axis goes no further than this, such as (0, 1) for a share.
    """
    width, top, row_height, bottom = 300.0, 30.0, 38.0, 20.0
    height = top + row_height * len(rows) + bottom
    label = f"{title}: {', '.join(row.name for row in rows)}"
    with _axes(width, height, label, (8.0, 64.0, top, bottom)) as (axes, drawn):
        axes.set_title(title, x=-8.0 / (width - 72.0))
        for k, row in enumerate(rows):
            _strip(axes, row, k, form)
        axes.grid(axis="y", visible=False)
        axes.spines.bottom.set_visible(False)
        axes.tick_params(bottom=False)
        low, high = axes.get_xlim()
        room = 0.06 * (high - low)
        if limits is not None:
            room = 0.06 * min(high - low, limits[1] - limits[0])
            low, high = max(low, limits[0]), min(high, limits[1])
        axes.set(xlim=(low - room, high + room), ylim=(len(rows) - 0.35, -0.65), yticks=[])
        ticks = _round(4).tick_values(low, high)
        axes.set_xticks([tick for tick in ticks if low - room <= tick <= high + room
                         and (limits is None or limits[0] <= tick <= limits[1])])  # fmt: skip
        axes.xaxis.set_major_formatter(_ticks(form))
    return drawn[0]


def _strip(axes: Axes, row: Strip, at: int, form: Form) -> None:
    colour = _COLOUR[f"c{row.colour}"]
    beside: Any = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points",
                   "va": "center_baseline", "weight": "bold"}  # fmt: skip
    axes.annotate(row.name.replace("_", " "), (0.0, at), (-2.0, 15.0), color=colour, **beside)
    ink = _COLOUR["ink"]
    axes.annotate(form(row.value), (1.0, at), (62.0, 0.0), color=ink, ha="right", **beside)
    if row.low is not None and row.high is not None:
        axes.plot([row.low, row.high], [at, at], color=colour, linewidth=7, alpha=0.28,
                  gid=_told(f"{form(row.low)} to {form(row.high)}"))  # fmt: skip
    edge: Any = {"color": _COLOUR["paper"], "markeredgecolor": colour, "markeredgewidth": 1.5}
    if math.isfinite(row.zero_action):
        told = _told(f"zero action: {form(row.zero_action)}")
        axes.plot([row.zero_action], [at], "D", markersize=6.5, gid=told, **edge)
    for value in row.values:
        axes.plot([value], [at], "o", markersize=7, color=colour, gid=_told(form(value)),
                  markeredgecolor=_COLOUR["paper"])  # fmt: skip
    axes.plot([row.value], [at], "|", color=colour, markersize=13, markeredgewidth=2.2)


def bars(
    groups: Sequence[str],
    named: Sequence[tuple[str, int, Sequence[float]]],
    title: str,
    form: Form = number,
    top: float | None = None,
) -> Markup:
    """Horizontal bars, grouped, with their values at their ends.

    Args:
        groups: names, from top to bottom.
        named: (name, colour, value for each group), one bar in every group each; NaN for none.
        title: what is shown, with its unit.
        form: of the values.
        top: end of the axis. None: what the longest bar needs.
    """
    head = 28.0 + 14.0 * len(named)
    step = 13.0 * len(named) + 12.0
    height = head + step * len(groups) + 18.0
    label = f"{title}: {', '.join(name for name, _, _ in named)}"
    with _axes(WIDTH, height, label, (96.0, 44.0, head, 18.0)) as (axes, drawn):
        title_at = 1.0 + (head - 18.0) / (step * len(groups))
        axes.set_title(title, x=-96.0 / (WIDTH - 140.0), y=title_at, pad=0)
        for k, (name, colour, values) in enumerate(named):
            at = np.arange(len(groups)) + (k - 0.5 * (len(named) - 1)) * 13.0 / step
            its = axes.barh(at, values, 11.0 / step, color=_COLOUR[f"c{colour}"], label=name)
            told = [form(value) if math.isfinite(value) else "" for value in values]
            axes.bar_label(its, told, padding=3.0)
        axes.grid(axis="y", visible=False)
        axes.spines.bottom.set_visible(False)
        axes.tick_params(bottom=False)
        axes.set(ylim=(len(groups) - 0.5, -0.5), xlim=(0.0, top))
        axes.set_yticks(range(len(groups)), groups)
        axes.xaxis.set_major_locator(_round(4))
        axes.xaxis.set_major_formatter(_ticks(form))
        axes.legend(loc="lower left", bbox_to_anchor=(-0.02, 1.0), frameon=False, borderpad=0.0,
                    labelspacing=0.2, handlelength=1.2, borderaxespad=0.3)  # fmt: skip
    return drawn[0]


def polar(
    degrees: Sequence[float],
    named: Sequence[tuple[str, int, Sequence[float]]],
    title: str,
    unit: str,
    labels: Mapping[float, str],
    mark: tuple[float, float, str],
) -> Markup:
    """Closed curves about a centre; 0 degrees points up, angles go anticlockwise.

    Args:
        degrees: (K,) directions, all the way round.
        named: (name, colour, (K,) values) of each.
        title: what is shown.
        unit: of the values.
        labels: degrees -> name of a direction, written outside.
        mark: (degrees, value, name) of one point to compare with.
    """
    label = f"{title}: {', '.join(name for name, _, _ in named)}"
    with _axes(WIDTH, 350.0, label, (80.0, 80.0, 48.0, 62.0), "polar") as (axes, drawn):
        axes.set_title(title, x=-80.0 / (WIDTH - 160.0), y=1.14, pad=0)
        axes.set_theta_zero_location("N")  # type: ignore[attr-defined]
        around = np.radians([*degrees, degrees[0]])
        for name, colour, values in named:
            axes.plot(around, [*values, values[0]], "o-", color=_COLOUR[f"c{colour}"], label=name,
                      markersize=5, gid=_told(name), markeredgecolor=_COLOUR["paper"])  # fmt: skip
        axes.plot(np.radians(mark[0]), mark[1], "D", color=_COLOUR["c7"], label=mark[2])
        axes.set_xticks(np.radians(list(labels)), [""] * len(labels))
        axes.set_ylim(0.0, 1.05 * max(max(values) for _, _, values in named))
        for angle, words in labels.items():
            across, up = -np.sin(np.radians(angle)), np.cos(np.radians(angle))
            side = "center" if abs(across) < 0.3 else "left" if across > 0 else "right"
            axes.annotate(words, (np.radians(angle), axes.get_ylim()[1]), (8 * across, 11 * up),
                          textcoords="offset points", ha=side, va="center_baseline",
                          annotation_clip=False)  # fmt: skip
        axes.set_rlabel_position(-22.5)  # type: ignore[attr-defined]
        axes.yaxis.set_major_locator(_round(4, prune="lower"))
        axes.yaxis.set_major_formatter(_ticks(lambda value: f"{number(value)} {unit}"))
        axes.spines["polar"].set_visible(False)
        axes.legend(loc="upper left", bbox_to_anchor=(-0.35, -0.1), frameon=False, fontsize=10.5,
                    ncols=2, borderpad=0.0)  # fmt: skip
    return drawn[0]


def sheet(panels: Sequence[str], columns: int = 2) -> str:
    """Return panels side by side as one SVG file, which brings its style along."""
    across, down = WIDTH + _GAP, HEIGHT + _GAP
    width, height = columns * across, -(-len(panels) // columns) * down
    placed = []
    for index, part in enumerate(panels):
        x, y = across * (index % columns) + _GAP / 2, down * (index // columns) + _GAP / 2
        where = f'x="{x:.0f}" y="{y:.0f}" width="{WIDTH:.0f}" height="{HEIGHT:.0f}"'
        placed.append(str(part).replace("<svg ", f"<svg {where} ", 1))
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'viewBox="0 0 {width:.0f} {height:.0f}"><style>{STYLE} svg {{ width: auto; }}</style>'
        f'<rect width="100%" height="100%" style="fill: var(--paper)"/>{"".join(placed)}</svg>\n'
    )


@contextmanager
def _axes(
    width: float,
    height: float,
    label: str,
    edges: tuple[float, float, float, float],
    projection: str | None = None,
) -> Iterator[tuple[Axes, list[Markup]]]:
    """Yield axes with room to the left, right, above and below, and a list: the SVG, once drawn."""
    left, right, top, bottom = edges
    inner = (left / width, bottom / height, 1 - (left + right) / width, 1 - (top + bottom) / height)
    drawn: list[Markup] = []
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(width / 72.0, height / 72.0))
        yield figure.add_axes(inner, projection=projection), drawn
        file = StringIO()
        figure.savefig(file, format="svg", transparent=True, metadata=dict.fromkeys(
            ("Date", "Creator", "Format", "Type")))  # fmt: skip
    drawn.append(_inlined(file.getvalue(), label))


def _inlined(svg: str, label: str) -> Markup:
    """Return what matplotlib wrote as part of a page: its colours and fonts, no ids, few digits."""
    view, body = re.search(r'viewBox="[^"]*"', svg), svg[svg.index("<defs>") :]
    own = "x" + hashlib.sha256(body.encode()).hexdigest()[:6]
    for pattern, text in (
        (r"(?s)<style.*?</style>|<!--.*?-->", ""),
        (r'<g id="told ([^"]*)">', r"<g><title>\1</title>"),
        (r'<g id="[^"]*"', "<g"),
        (r'(id="|#)([mp][0-9a-f]{10})', rf"\1\2{own}"),  # of this figure alone
        (r'font-family: [^;"]*;? ?|<g> *</g>', ""),
        (r"\s*\n\s*", " "),
    ):
        body = re.sub(pattern, text, body)
    body = re.sub(r' (?:d|x|y|transform)="[^"]*"', _rounded, body)
    for name, stand_in in _COLOUR.items():
        body = body.replace(stand_in, f"var(--{name})")
    assert view is not None
    opening = f'<svg {view[0]} role="img" aria-label="{html.escape(label)}">'
    return Markup(opening + body)


def _rounded(numbers: re.Match[str]) -> str:
    return re.sub(r"(?<=\d)\.(\d)\d+", r".\1", numbers[0])


def _told(text: str) -> str:
    """Return the id by which an artist gets a tooltip."""
    return f"told {text}"


def _round(most: int, **options: Any) -> MaxNLocator:
    """Ticks at round numbers, at most so many spaces apart."""
    return MaxNLocator(most, steps=[1, 2, 2.5, 5, 10], **options)


def _ticks(form: Form) -> FuncFormatter:
    """Write ticks, without zeros at the end of decimals."""

    def written(value: float, _: object) -> str:
        text = form(value)
        return text.rstrip("0").rstrip(".") if "." in text else text

    return FuncFormatter(written)
