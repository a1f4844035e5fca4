"""The figures of the pages.

Every colour is one of `style.css`, so that a figure turns dark with its page; values are told by
tooltips. A curve is named in the margin beside the axes and nowhere in them, so that no name lies
on a curve.
"""

import math
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator
from scipy.optimize import isotonic_regression

from eval.page.svg import COLOUR, TickLabels, axes_of, round_ticks, tooltip
from eval.results import Estimate
from eval.wording import Form, capital, form_of, number, span, titled
from train.episodes import Metric

STYLE = (Path(__file__).parent / "style.css").read_text()
WIDTH, HEIGHT = 400.0, 270.0
_BOTTOM, _LINE, _GAP = 36.0, 13.0, 24.0
Values = Sequence[float] | np.ndarray

NUM_COLOURS = 10  # of the page's style, `c0`, `c1` and so on

COLOURS = (
    "base acceleration",
    "joint position",
    "torque",
    "joint acceleration",
    "com wrench",
    "joint position feedforward",
)
"""A layer has the same colour in every report; layers with options take the remaining ones."""


def colours_of(names: Iterable[str]) -> dict[str, int]:
    """Return the number of the colour of each name: of a layer, of one with options, of an arm."""
    words = {name: name.replace("_", " ") for name in names}
    chosen = {name: COLOURS.index(its) for name, its in words.items() if its in COLOURS}
    free = [k for k in range(NUM_COLOURS) if k not in chosen.values()]
    for k, name in enumerate(sorted(words.keys() - chosen.keys())):
        chosen[name] = free[k % len(free)]
    return chosen


@dataclass(frozen=True)
class Series:
    """One curve with what belongs to it."""

    name: str
    colour: int
    x: Values
    value: Values  # NaN where there is nothing
    low: Values | None = None
    high: Values | None = None
    singles: Sequence[tuple[Values, Values]] = field(default=())
    """Curves of single runs, drawn thin."""
    dashed: Values | None = None  # a curve to compare with on the same abscissae, drawn dashed
    dots: bool = False  # mark the points of the curve

    @classmethod
    def constant(cls, name: str, colour: int, until: float, value: Estimate) -> "Series":
        """Make one that does not change, from 0 to the abscissa `until`, with its interval."""
        low, high = (None if end is None else [end, end] for end in (value.low, value.high))
        return cls(name, colour, [0.0, until], [value.value] * 2, low, high)


@dataclass(frozen=True)
class Marks:
    """Further marks in a panel; None: nothing."""

    upright: float | None = None  # abscissa of an upright line
    logarithmic: bool = False  # whether the vertical axis is


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
    """Lines with bands, named beside their ends; curves without any finite value are left out.

    The title says what the vertical axis shows. Without ranges, axes show what the data need, the
    horizontal one zero as well.
    """
    series = [item for item in series if np.isfinite(item.value).any()]
    names = [item.name for item in series]
    height = max(HEIGHT, sum(map(_height, names)) + 52.0)  # no name beside the ticks, or below
    with axes_of(WIDTH, height, title, names, (44.0, 118.0, 30.0, _BOTTOM)) as (axes, drawn):
        axes.set_xlabel(x_title, loc="right", color=COLOUR["soft"])
        for item in series:
            _curve(axes, item)
        if marks.upright is not None:
            axes.axvline(marks.upright, color=COLOUR["faint"], linewidth=1, linestyle=":")
        axes.grid(axis="x", visible=False)
        axes.margins(x=0.0, y=0.06)
        axes.autoscale()
        if marks.logarithmic:
            axes.set_yscale("log")
            axes.yaxis.set_major_locator(LogLocator(numticks=6))
            axes.minorticks_off()
        else:
            axes.yaxis.set_major_locator(round_ticks(5))
        x_low, x_high = axes.get_xlim()
        axes.set_xlim(x_range or (min(0.0, x_low), x_high))
        low, high = axes.get_ylim()
        least = min((float(np.min(line.get_ydata())) for line in axes.lines), default=0.0)
        axes.set_ylim(y_range or (0.0 if low < 0.0 <= least else low, high))
        axes.xaxis.set_major_locator(round_ticks(4))
        axes.xaxis.set_major_formatter(TickLabels(x_format))
        axes.yaxis.set_major_formatter(TickLabels(y_format))
        if series:
            _name_ends(axes, series, height)
    return drawn[0]


def _curve(axes: Axes, item: Series) -> None:
    colour = COLOUR[f"c{item.colour}"]
    if item.low is not None and item.high is not None and len(item.x) > 1:
        axes.fill_between(item.x, item.low, item.high, color=colour, alpha=0.14, linewidth=0)
    if item.dashed is not None:
        axes.plot(item.x, item.dashed, gid=tooltip(f"{item.name}, zero action"),
                  color=colour, linewidth=1.3, linestyle=(0, (4, 3)), alpha=0.8)  # fmt: skip
    for x, y in item.singles:
        axes.plot(x, y, color=colour, linewidth=0.9, alpha=0.55)
    dots = item.dots or np.isfinite(item.value).sum() == 1
    axes.plot(item.x, item.value, color=colour, gid=tooltip(item.name), marker="o" if dots else "",
              markersize=5.5, markeredgecolor=COLOUR["paper"], clip_on=not dots)  # fmt: skip


def _name_ends(axes: Axes, series: Sequence[Series], height: float) -> None:
    """Write names into the margin, as near to the ends of their curves as others leave room."""
    named = []
    for item in series:
        known = np.asarray(item.value, float)[np.isfinite(item.value)]
        named.append((item.name, f"c{item.colour}", float(known[-1])))
    scale = axes.get_position().height * height
    wrapped = [_wrapped(name) for name, _, _ in named]
    heights = [_height(name) for name, _, _ in named]
    at = axes.transAxes.inverted().transform(axes.transData.transform([(0, y) for *_, y in named]))
    centres = apart(scale * (1.0 - at[:, 1]), heights, -10.0, scale + 4.0)  # clear of the ticks
    for (_, colour, _), lines, centre in zip(named, wrapped, centres, strict=True):
        for k, line in enumerate(lines):
            below = centre + _LINE * (k - 0.5 * (len(lines) - 1))
            axes.annotate(line, (1.0, 1.0), (6.0, -below), xycoords="axes fraction",
                          textcoords="offset points", va="center_baseline",
                          color=COLOUR[colour], weight="bold")  # fmt: skip


def _wrapped(name: str) -> list[str]:
    return textwrap.wrap(name.replace("_", " "), 18, break_long_words=False) or [""]


def _height(name: str) -> float:
    return _LINE * len(_wrapped(name)) + 3.0


def apart(
    wanted: Sequence[float] | np.ndarray, heights: Sequence[float], low: float, high: float
) -> np.ndarray:
    """Move the centres (N,) of labels apart until none overlaps, as little as possible.

    No label crosses the edge `low`; where there are too many, they cross `high`.
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


class Strip(NamedTuple):
    """One layer in a strip plot: a value per run, what they say together, the zero action's."""

    name: str
    colour: int
    values: Values
    found: Estimate
    zero_action: float


def strips(rows: Sequence[Strip], metric: Metric) -> Markup:
    """One metric: a row per layer with every run, their interquartile mean and its interval."""
    form, limits = form_of(metric), (0.0, 1.0) if metric.unit == "share" else (-np.inf, np.inf)
    arrow = {1: " (more is better)", -1: " (less is better)", 0: ""}[metric.better]
    edges, height = (8.0, 64.0, 30.0, 20.0), 50.0 + 38.0 * len(rows)
    names = [row.name for row in rows]
    with axes_of(300.0, height, capital(titled(metric)) + arrow, names, edges) as (axes, drawn):
        for k, row in enumerate(rows):
            _strip(axes, row, k, form)
        axes.grid(axis="y", visible=False)
        axes.spines.bottom.set_visible(False)
        low, high = np.clip(axes.get_xlim(), *limits)
        room = 0.06 * (high - low)
        axes.set(xlim=(low - room, high + room), ylim=(len(rows) - 0.35, -0.65), yticks=[])
        ticks = round_ticks(4).tick_values(low, high)
        axes.set_xticks([tick for tick in ticks if low <= tick <= high])
        axes.tick_params(bottom=False)
        axes.xaxis.set_major_formatter(TickLabels(form))
    return drawn[0]


def _strip(axes: Axes, row: Strip, at: int, form: Form) -> None:
    colour, paper, found = COLOUR[f"c{row.colour}"], COLOUR["paper"], row.found
    beside: Any = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points",
                   "va": "center_baseline", "weight": "bold"}  # fmt: skip
    axes.annotate(row.name.replace("_", " "), (0.0, at), (-2.0, 15.0), color=colour, **beside)
    ink = COLOUR["ink"]
    axes.annotate(form(found.value), (1.0, at), (62.0, 0.0), color=ink, ha="right", **beside)
    if found.low is not None and found.high is not None:
        ends, told = [found.low, found.high], tooltip(span(found, form))
        axes.plot(ends, [at, at], color=colour, linewidth=7, alpha=0.28, gid=told)
    if math.isfinite(row.zero_action):
        told = tooltip(f"zero action: {form(row.zero_action)}")
        axes.plot([row.zero_action], [at], "D", markersize=6.5, gid=told, color=paper,
                  markeredgecolor=colour, markeredgewidth=1.5)  # fmt: skip
    for value in row.values:
        told = tooltip(form(value))
        axes.plot([value], [at], "o", ms=7, color=colour, gid=told, markeredgecolor=paper)
    axes.plot([found.value], [at], "|", color=colour, markersize=13, markeredgewidth=2.2)


def bars(
    groups: Sequence[str],
    named: Sequence[tuple[str, int, Sequence[float]]],
    title: str,
    form: Form = number,
    top: float | None = None,
) -> Markup:
    """Horizontal bars in groups, with their values at their ends; NaN for none.

    Each of `named` (name, colour, values) has a bar in every group. The axis ends at `top`, by
    default where the longest bar needs it.
    """
    head = 28.0 + 14.0 * len(named)
    step = 13.0 * len(named) + 12.0
    height = head + step * len(groups) + 18.0
    names, edges = [name for name, _, _ in named], (96.0, 44.0, head, 18.0)
    with axes_of(WIDTH, height, title, names, edges) as (axes, drawn):
        for k, (name, colour, values) in enumerate(named):
            at = np.arange(len(groups)) + (k - 0.5 * (len(named) - 1)) * 13.0 / step
            its = axes.barh(at, values, 11.0 / step, color=COLOUR[f"c{colour}"], label=name)
            told = [form(value) if math.isfinite(value) else "" for value in values]
            axes.bar_label(its, told, padding=3.0)
        axes.grid(axis="y", visible=False)
        axes.spines.bottom.set_visible(False)
        axes.tick_params(bottom=False)
        axes.set(ylim=(len(groups) - 0.5, -0.5), xlim=(0.0, top))
        axes.set_yticks(range(len(groups)), groups)
        axes.xaxis.set_major_locator(round_ticks(4))
        axes.xaxis.set_major_formatter(TickLabels(form))
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
    """Closed curves (name, colour, values) about a centre, over directions all the way round.

    0 degrees points up, angles go anticlockwise. Some directions have names, written outside; the
    mark (degrees, value, name) is a point to compare with.
    """
    names, edges = [name for name, _, _ in named], (80.0, 80.0, 48.0, 62.0)
    with axes_of(WIDTH, 350.0, title, names, edges, "polar") as (axes, drawn):
        axes.set_theta_zero_location("N")  # type: ignore[attr-defined]
        around = np.radians([*degrees, degrees[0]])
        for name, colour, values in named:
            axes.plot(around, [*values, values[0]], "o-", color=COLOUR[f"c{colour}"], label=name,
                      markersize=5, gid=tooltip(name), markeredgecolor=COLOUR["paper"])  # fmt: skip
        axes.plot(np.radians(mark[0]), mark[1], "D", color=COLOUR["c7"], label=mark[2])
        axes.set_xticks(np.radians(list(labels)), [""] * len(labels))
        axes.set_ylim(0.0, 1.05 * max(max(values) for _, _, values in named))
        for angle, words in labels.items():
            across, up = -np.sin(np.radians(angle)), np.cos(np.radians(angle))
            side = "center" if abs(across) < 0.3 else "left" if across > 0 else "right"
            axes.annotate(words, (np.radians(angle), axes.get_ylim()[1]), (8 * across, 11 * up),
                          textcoords="offset points", ha=side, va="center_baseline",
                          annotation_clip=False)  # fmt: skip
        axes.set_rlabel_position(-22.5)  # type: ignore[attr-defined]
        axes.yaxis.set_major_locator(round_ticks(4, prune="lower"))
        axes.yaxis.set_major_formatter(TickLabels(lambda value: f"{number(value)} {unit}"))
        axes.spines["polar"].set_visible(False)
        axes.legend(loc="upper left", bbox_to_anchor=(-0.35, -0.1), frameon=False, fontsize=10.5,
                    ncols=2, borderpad=0.0)  # fmt: skip
    return drawn[0]


def sheet(panels: Sequence[str], columns: int = 2) -> str:
    """Return panels side by side as one SVG file, which brings its style along."""
    found = [re.search(r'viewBox="0 0 \S+ ([^"]+)"', part) for part in panels]
    heights = [float(box[1]) if box else HEIGHT for box in found]
    across, down = WIDTH + _GAP, max(heights, default=HEIGHT) + _GAP
    width, height = columns * across, -(-len(panels) // columns) * down
    placed = []
    for index, (part, own) in enumerate(zip(panels, heights, strict=True)):
        x, y = across * (index % columns) + _GAP / 2, down * (index // columns) + _GAP / 2
        where = f'x="{x:.0f}" y="{y:.0f}" width="{WIDTH:.0f}" height="{own:.0f}"'
        placed.append(str(part).replace("<svg ", f"<svg {where} ", 1))
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'viewBox="0 0 {width:.0f} {height:.0f}"><style>{STYLE} svg {{ width: auto; }}</style>'
        f'<rect width="100%" height="100%" style="fill: var(--paper)"/>{"".join(placed)}</svg>\n'
    )
