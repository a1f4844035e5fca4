"""The comparison as one self-contained HTML page: no file, font or script from anywhere else."""

from collections.abc import Callable, Sequence
from html import escape

from eval.clips import STARTS, Shown, fate, side_by_side
from eval.colours import colours_of
from eval.comparison import Clips
from eval.document import document
from eval.methods import methods, reproduction
from eval.papers.parts import table
from eval.plots import Marks, Series, Strip, panel, strips
from eval.results import Comparison, Layer
from eval.wording import (
    capital,
    caution,
    count,
    crossing,
    duration,
    headline,
    interval,
    lede,
    number,
    percent,
    steps,
)
from train.episodes import METRICS, Metric

_SHOWN = (
    "returned", "survived", "velocity_error", "turning_error", "height_error", "torque", "power",
    "slip", "cost_of_transport", "foothold_error",
)  # fmt: skip


def page(comparison: Comparison, clips: Clips | None, command: Sequence[str] = ()) -> str:
    """Lay out the whole report.

    Args:
        comparison: what was found.
        clips: videos, if there are any.
        command: the command line that made it, to be shown.
    """
    colours = colours_of(layer.name for layer in comparison.layers)
    body = [
        _opening(comparison),
        _curves(comparison, colours),
        _videos(clips, colours, comparison.env_id),
        _metrics(comparison, colours),
        _sweep(comparison, colours),
        _thresholds(comparison, colours),
        _pairs(comparison),
        _runs(comparison, colours),
        methods(comparison),
        reproduction(comparison, command),
    ]
    title = f"{_task(comparison)}: {' against '.join(layer.name for layer in comparison.layers)}"
    html = "\n".join(part for part in body if part)
    return document(title, html, script="" if clips is None else STARTS)


def _task(comparison: Comparison) -> str:
    return comparison.env_id.rpartition("/")[2]


def _opening(c: Comparison) -> str:
    seeds = sorted({layer.seeds for layer in c.layers})
    each = count(seeds[0], "seed") if len(seeds) == 1 else f"{seeds[0]} to {seeds[-1]} seeds"
    eyebrow = (
        f"{escape(c.env_id)} · {count(len(c.layers), 'action layer')} · {each} each · "
        f"{steps(c.budget)} steps of training"
    )
    parts = [
        f'<p class="eyebrow">{eyebrow}</p>',
        f"<h1>{escape(headline(c))}</h1>",
        '<div class="lede">',
        *(f"<p>{escape(sentence)}</p>" for sentence in lede(c)),
        "</div>",
    ]
    warning = caution(c)
    if warning:
        parts.append(f'<div class="callout"><b>How far to trust this.</b> {escape(warning)}</div>')
    if c.warnings:
        items = "".join(f"<li>{escape(text)}</li>" for text in c.warnings)
        parts.append(f'<div class="callout warning"><b>Before comparing.</b><ul>{items}</ul></div>')
    return "\n".join(parts)


def _curves(c: Comparison, colours: dict[str, int]) -> str:
    drawn = [layer for layer in c.layers if layer.by_steps and layer.by_wall]
    if not drawn:
        return (
            "<p>No learning curves: exported policies do not carry them. What follows compares "
            "the policies as they are.</p>"
        )
    slowest = max(layer.by_wall.grid[-1] for layer in drawn if layer.by_wall)
    unit, wall_title = (60.0, "wall-clock, min") if slowest > 180 else (1.0, "wall-clock, s")
    panels = []
    for axis, scale, title, form in (
        ("steps", 1.0, "training steps", steps),
        ("wall", unit, wall_title, number),
    ):
        series = []
        for layer in drawn:
            band = layer.by_steps if axis == "steps" else layer.by_wall
            assert band is not None
            singles = [([x / scale for x in getattr(run, axis)], run.returns) for run in layer.runs]
            series.append(
                Series(
                    layer.name,
                    colours[layer.name],
                    [x / scale for x in band.grid],
                    band.value,
                    band.low,
                    band.high,
                    singles if layer.seeds > 1 else (),
                    layer.zero_action["returned"],
                )
            )
        panels.append(panel(series, "Return", title, form, marks=Marks(threshold=c.threshold)))
    spread = (
        f"Thick: interquartile mean over seeds, with its {percent(c.settings.confidence)} "
        "bootstrap interval. Thin: single seeds. "
        if any(layer.seeds > 1 for layer in drawn)
        else "One seed per layer, hence no interval. "
    )
    return (
        f'<figure class="wide"><div class="grid2">{"".join(panels)}</div>'
        f"<figcaption>Learning, counted in steps and in time. {spread}Dashed: what the zero "
        "action earns through the same layer, before any learning."
        "</figcaption></figure>"
    )


def _videos(clips: Clips | None, colours: dict[str, int], env_id: str) -> str:
    if clips is None:
        return ""
    shown = [
        Shown(name, colours[name], f"{clips.run_names[name]}, {fate(clip)}", clip)
        for name, clip in clips.by_layer.items()
    ]
    same = (
        "Same seed, same start, the same commands if there are any, and the same pushes at the "
        "same times"
        if clips.same_pushes
        else "The pushes are of the same size but not at the same times, as the layers draw chance "
        "differently"
    )
    head, same = "The same push", f"{same}: {number(clips.push)} N each"
    if clips.push == 0:
        head, same = "The same start", "Same seed, same start, the same commands if there are any"
    return (
        f"<h2>{head}</h2>"
        f"<p>The median seed of each layer, the lower of two. {same}.</p>"
        f"{side_by_side(shown, env_id)}"
    )


def _form(metric: Metric) -> Callable[[float], str]:
    return percent if metric.unit == "share" else number


def _heading(metric: Metric) -> str:
    return metric.label + (f", {metric.unit}" if metric.unit not in ("", "share") else "")


def _metrics(c: Comparison, colours: dict[str, int]) -> str:
    figures = []
    for metric in METRICS:
        if metric.name not in _SHOWN or not _known(c, metric):
            continue
        rows = [
            Strip(
                layer.name,
                colours[layer.name],
                layer.values(metric.name).tolist(),
                layer.metrics[metric.name].value,
                layer.metrics[metric.name].low,
                layer.metrics[metric.name].high,
                layer.zero_action[metric.name],
            )
            for layer in c.layers
        ]
        arrow = {1: " (more is better)", -1: " (less is better)", 0: ""}[metric.better]
        limits = (0.0, 1.0) if metric.unit == "share" else None
        figures.append(strips(rows, capital(_heading(metric)) + arrow, _form(metric), limits))
    same = table(
        ["", *(layer.name for layer in c.layers), *(f"{x.name}, zero action" for x in c.layers)],
        [
            [
                escape(_heading(metric)),
                *(_cell(layer, metric) for layer in c.layers),
                *(_form(metric)(layer.zero_action[metric.name]) for layer in c.layers),
            ]
            for metric in METRICS
            if _known(c, metric)
        ],
    )
    level = percent(c.settings.confidence)
    return (
        "<h2>What the trained policies do</h2>"
        f"<p>{c.settings.episodes} fresh episodes per run with the deterministic policy; every run "
        "starts from the same seeds.</p>"
        f'<figure class="wide"><div class="grid3">{"".join(figures)}</div>'
        f"<figcaption>Dots: seeds. Bar: their interquartile mean, with its {level} interval. "
        "Diamond: zero action through the same layer. A robot that falls early spends fewer "
        "seconds on everything else: read the other metrics beside survival.</figcaption></figure>"
        f"<details><summary>The same as a table</summary>{same}</details>"
    )


def _known(c: Comparison, metric: Metric) -> bool:
    return all(layer.metrics[metric.name].value == layer.metrics[metric.name].value
               for layer in c.layers)  # fmt: skip  # NaN where the task does not report it


def _cell(layer: Layer, metric: Metric) -> str:
    value = layer.metrics[metric.name]
    form = _form(metric)
    if value.low is None or value.high is None:
        return form(value.value)
    return f'{form(value.value)} <span class="low">{form(value.low)} to {form(value.high)}</span>'


def _sweep(c: Comparison, colours: dict[str, int]) -> str:
    if not c.sweep:
        return ""
    series = [
        Series(
            layer.name,
            colours[layer.name],
            c.sweep,
            [point.value for point in layer.sweep],
            [point.low for point in layer.sweep if point.low is not None] or None,
            [point.high for point in layer.sweep if point.high is not None] or None,
            dashed=layer.zero_sweep,
            dots=True,
        )
        for layer in c.layers
    ]
    figure = panel(
        series,
        "Episodes survived",
        "size of every push, N",
        number,
        percent,
        y_range=(0.0, 1.04),
        marks=Marks(shaded_to=c.hardest_push),
    )
    rows = [
        [
            _layer(layer.name, colours),
            *(interval(point, percent) for point in layer.sweep),
        ]
        for layer in c.layers
    ]
    rows += [
        [f"{escape(layer.name)}, zero action", *(percent(share) for share in layer.zero_sweep)]
        for layer in c.layers
    ]
    same = table(["", *(f"{number(push)} N" for push in c.sweep)], rows)
    return (
        "<h2>How hard a push they take</h2>"
        f"<p>Every push of an episode has the size given; {c.settings.sweep_episodes} episodes of "
        f"{number(c.settings.sweep_seconds)} s per run and size.</p>"
        f'<figure class="one">{figure}<figcaption>Shaded: sizes met in training, up to '
        f"{number(c.hardest_push)} N. Dashed: zero action.</figcaption></figure>"
        f"<details><summary>The same as a table</summary>{same}</details>"
    )


def _thresholds(c: Comparison, colours: dict[str, int]) -> str:
    if c.threshold is None:
        return ""
    rows = [
        [
            _layer(layer.name, colours),
            f"{layer.steps_to.reached} of {layer.seeds}",
            escape(crossing(layer.steps_to, steps)),
            escape(crossing(layer.wall_to, duration)),
        ]
        for layer in c.layers
        if layer.steps_to is not None
    ]
    chosen = (
        ""
        if c.settings.threshold is not None
        else f", {percent(c.settings.threshold_share)} of the way from the lowest first to the "
        "highest last evaluation of any layer"
    )
    return (
        f"<h2>Time to a return of {number(c.threshold)}</h2>"
        f"<p>When the evaluations during training first reach {number(c.threshold)}{chosen}: "
        "interpolated between evaluations, median over seeds, with its interval. A run that never "
        "gets there counts as later than any that does, one that is there at its first evaluation "
        "as getting there then.</p>"
        + table(["", "runs that reach it", "steps", "wall-clock"], rows)
    )


def _pairs(c: Comparison) -> str:
    if not c.pairs:
        return ""
    rows = [
        [
            f"{escape(pair.better)} over {escape(pair.other)}",
            interval(pair.difference),
            interval(pair.probability),
            number(pair.p_value, 2),
        ]
        for pair in c.pairs
    ]
    return (
        "<h2>How sure is the order?</h2>"
        "<p>The difference of the final returns; the probability that a run of the first layer "
        "beats a run of the second (one half: no difference); and how often shuffling the runs "
        "between the two layers would move that probability as far from one half, either way. "
        "Where every run of one layer beats every run of the other, the interval of the "
        "probability has no width: a limit of resampling so few runs, not certainty. The last "
        "column does not have it.</p>"
        + table(["", "difference", "probability of improvement", "by chance"], rows)
    )


def _runs(c: Comparison, colours: dict[str, int]) -> str:
    rows = [
        [
            escape(run.name),
            _layer(layer.name, colours),
            "–" if run.seed is None else str(run.seed),
            steps(run.trained_steps),
            "–" if run.wall_seconds is None else duration(run.wall_seconds),
            *(_form(m)(run.metrics[m.name]) for m in METRICS if m.name in _SHOWN and _known(c, m)),
        ]
        for layer in c.layers
        for run in layer.runs
    ]
    shown = [_heading(m) for m in METRICS if m.name in _SHOWN and _known(c, m)]
    heads = ["run", "layer", "seed", "steps", "wall-clock", *shown]
    return "<h2>Every run</h2>" + table(heads, rows)


def _layer(name: str, colours: dict[str, int]) -> str:
    return f'<span class="layer c{colours[name]}">{escape(name)}</span>'
