"""The findings as one self-contained HTML page, and the figures of all factors as one sheet."""

import json
import shlex
from collections.abc import Mapping, Sequence
from functools import partial
from html import escape

from eval.colours import colours_of
from eval.document import document
from eval.papers.parts import figure, folded, table, text
from eval.plots import Marks, Series, panel, sheet
from eval.robustness.curves import CONFIDENCE, SAMPLES, Along, Curve, Robustness
from eval.robustness.tables import BY_NAME, cell, heading, more_is_better, summary, written
from eval.robustness.wording import headline, lede
from eval.wording import capital, count, number, percent


def page(found: Robustness, command: Sequence[str] = ()) -> str:
    """Lay out the page.

    Args:
        found: what to show.
        command: the command line that made it, to be shown.
    """
    parts = [
        _opening(found),
        "<h2>All of it</h2>",
        areas(found),
        *(_along(found, along) for along in found.along),
        _methods(found),
        _reproduction(found, command),
    ]
    title = f"Robustness in {found.env_id.rpartition('/')[2]}"
    return document(title, "\n".join(parts))


def drawn(found: Robustness) -> str:
    """Return the figures of all factors as SVG, a row for each."""
    return sheet([one for along in found.along for one in panels(found, along)])


def panels(found: Robustness, along: Along, colours: Mapping[str, int] | None = None) -> list[str]:
    """Return the figure of a factor: a panel for each measure, all arms in it.

    Args:
        found: what was found.
        along: one factor of it.
        colours: of the arms; None: those of their layers.
    """
    factor = BY_NAME[along.name]
    if colours is None:
        of_layers = colours_of(dict.fromkeys(found.arms.values()))
        colours = {arm: of_layers[layer] for arm, layer in found.arms.items()}
    made = []
    for measure in found.measures:
        limits = (0.0, 1.04) if measure == "survived" else None
        marks = Marks(upright=along.nominal)
        made.append(
            panel(
                _series(found, along.values, along.curves[measure], colours),
                f"{heading(measure)}: {factor.title}",
                factor.axis,
                factor.written,
                partial(written, measure),
                (along.values[0], along.values[-1]),
                limits,
                marks,
            )
        )
    return made


def _series(
    found: Robustness,
    values: Sequence[float],
    curves: dict[str, Curve],
    colours: Mapping[str, int],
) -> list[Series]:
    """A line for each arm; the zero action of a layer that was trained is dashed beside it."""
    trained = {layer: arm for arm, layer in found.arms.items() if found.runs[arm]}
    zero = {
        layer: curves[arm]
        for arm, layer in found.arms.items()
        if not found.runs[arm] and layer in trained
    }
    series = []
    for arm, layer in found.arms.items():
        if not found.runs[arm] and layer in zero:
            continue
        points = curves[arm].points
        low = [point.low for point in points if point.low is not None]
        high = [point.high for point in points if point.high is not None]
        series.append(
            Series(
                arm,
                colours[arm],
                values,
                [point.value for point in points],
                low or None,
                high or None,
                dashed=[point.value for point in zero[layer].points] if layer in zero else None,
                dots=True,
            )
        )
    return series


def _opening(found: Robustness) -> str:
    budget = found.budget
    seconds = found.env_args.get("episode_seconds")
    eyebrow = (
        f"{escape(found.env_id)} · {count(len(found.arms), 'arm')} · "
        f"{budget.episodes} episodes of {number(float(seconds or 0.0))} s at every value"
    )
    parts = [f'<p class="eyebrow">{eyebrow}</p>', f"<h1>{escape(headline(found))}</h1>"]
    parts += [f'<div class="lede">{text(*map(escape, lede(found)))}</div>']
    parts += [
        text(
            "One thing at a time is otherwise than in training, all else is as it was: start, "
            "commands, pushes and whatever the policies were trained to meet. What is ahead here "
            "is ahead by its area, with an interval that lies beyond all others'."
        )
    ]
    if found.warnings:
        items = "".join(f"<li>{escape(text)}</li>" for text in found.warnings)
        parts.append(f'<div class="callout warning"><b>Before comparing.</b><ul>{items}</ul></div>')
    if found.left_out:
        items = "".join(
            f"<li><b>{escape(name)}</b>: {escape(reason)}.</li>"
            for name, reason in found.left_out.items()
        )
        parts.append(f'<div class="callout"><b>Left out.</b><ul>{items}</ul></div>')
    return "\n".join(parts)


def areas(found: Robustness) -> str:
    """Return the mean of each measure along each factor as HTML tables."""
    parts = []
    for measure in found.measures:
        heads, rows = summary(found, measure)
        better = "more" if more_is_better(measure) else "less"
        parts.append(text(f"<b>{escape(heading(measure))}</b>, {better} is better."))
        parts.append(table(heads, [[escape(one) for one in row] for row in rows]))
    parts.append(
        text(
            "Area under the curve over the length of its axis: the mean along the factor, with its "
            f"{percent(CONFIDENCE)} interval. A change is that from the first stage to the last."
        )
    )
    return "\n".join(parts)


def _along(found: Robustness, along: Along) -> str:
    factor = BY_NAME[along.name]
    dashed = _is_dashed(found)
    caption = (
        f"Bands: {percent(CONFIDENCE)} intervals."
        + (" Upright: nothing differs." if along.nominal is not None and not factor.stages else "")
        + (" Dashed: the zero action of the same layer." if dashed else "")
        + (" The velocity error counts until a robot falls: read it beside survival."
           if "velocity_error" in found.measures else "")
    )  # fmt: skip
    values = [factor.written(value) for value in along.values]
    last = "change" if factor.stages else "area"
    blocks = []
    for measure in found.measures:
        rows = [
            [escape(arm), *(cell(measure, one) for one in [*curve.points, curve.summary])]
            for arm, curve in along.curves[measure].items()
        ]
        blocks.append(table([heading(measure), *values, last], rows))
    return "\n".join(
        [
            f'<h2 id="{escape(along.name)}">{escape(capital(factor.title))}</h2>',
            text(escape(factor.about)),
            figure(panels(found, along), caption),
            folded("The same as tables", "".join(blocks)),
        ]
    )


def _is_dashed(found: Robustness) -> bool:
    trained = {layer for arm, layer in found.arms.items() if found.runs[arm]}
    return any(not found.runs[arm] and layer in trained for arm, layer in found.arms.items())


def _methods(found: Robustness) -> str:
    units = []
    for arm in found.arms:
        runs = found.runs[arm]
        what = f"over {count(len(runs), 'run')}" if len(runs) > 1 else (
            "over the episodes of one run: how well that run is known, not how well the next "
            "would do" if runs else "over episodes"
        )  # fmt: skip
        units.append(f"<li>{escape(arm)}: {what}.</li>")
    return "\n".join(
        [
            "<h2>How it was measured</h2>",
            text(
                f"Robots stand side by side, each for one episode, robot i with seed "
                f"{found.budget.seed} + i: every arm at every value meets the same starts, "
                "commands and times of pushes. Policies act without noise. A robot survives that "
                "does not fall until its time is up. What is the same at two values, such as all "
                "the nominal ones, was played once.",
                f"Intervals are percentiles of {SAMPLES:,} bootstrap resamples. Of several runs, "
                "each is averaged first, and the estimate is the interquartile mean over runs; "
                "otherwise it is the mean over episodes. Where all agree an interval has no "
                "width: a limit of resampling, not certainty.",
            ),
            f"<ul>{''.join(units)}</ul>",
        ]
    )


def _reproduction(found: Robustness, command: Sequence[str]) -> str:
    shared = {"env_id": found.env_id, "env_args": found.env_args}
    blocks = {"Environment": json.dumps(shared, indent=1), "Command": shlex.join(command)}
    if found.versions:
        blocks["Versions"] = json.dumps(found.versions, indent=1)
    return "\n".join(
        folded(name, f"<pre>{escape(content)}</pre>") for name, content in blocks.items() if content
    )
