"""An environment in the report of a study: curves, tables, clips and robustness of its arms."""

import math
from collections.abc import Callable, Mapping, Sequence
from html import escape

from eval.clips import Shown, side_by_side
from eval.papers.parts import figure, folded, heading, table, text
from eval.plots import Series, Strip, panel, strips
from eval.results import Band, Crossing
from eval.robustness.curves import Robustness
from eval.robustness.page import areas, panels
from eval.robustness.tables import BY_NAME
from eval.study.pace import Pace
from eval.study.parts import colours, form_of, in_cell, named, probability, titled, told
from eval.study.results import CURVES, JUDGED, MEASURES, ArmFound, Findings, Measure, Versus
from eval.wording import capital, number, percent, steps
from train.runs.study import environment_name

Clips = Mapping[tuple[str, str], Shown]
"""Environment and arm -> its clip."""


def environment(found: Findings, env_id: str, clips: Clips, robustness: Robustness | None) -> str:
    """Return the section of an environment as HTML."""
    arms = found.environments()[env_id]
    name = escape(environment_name(env_id))
    parts = [f'<h2 id="{name}">{name}</h2>']
    measured = [arm for arm in arms if arm.counted]
    if not measured:
        parts.append(text("Nothing of it has been evaluated yet."))
        return "\n".join([*parts, _arms(found, arms)])
    parts += [
        _curves(found, measured),
        _arms(found, arms),
        _strips(found, measured),
        _thresholds(found, measured),
        _judged(found, arms),
        _fresh(found, arms),
        _clips(clips, env_id),
        _robustness(found, robustness),
    ]
    return "\n".join(filter(None, parts))


def _curves(found: Findings, arms: Sequence[ArmFound]) -> str:
    panels = []
    for measure in CURVES:
        for axis, bands in (("steps", "by_steps"), ("wall", "by_wall")):
            drawn = [arm for arm in arms if measure.name in getattr(arm, bands)]
            if drawn:
                panels.append(_panel(found, drawn, measure, axis, bands))
    return figure(
        panels,
        "Policies without noise, evaluated during training, over steps and over time. Thick: "
        f"interquartile mean over seeds, with its {percent(found.settings.confidence)} bootstrap "
        "interval. Thin: single seeds, those not finished among them.",
    )


def _panel(
    found: Findings, arms: Sequence[ArmFound], measure: Measure, axis: str, bands: str
) -> str:
    scale, title, form = _axis(arms, axis)
    pace, colour = Pace.of((arm.name, arm.most) for arm in arms), colours(found)
    series = []
    for arm in arms:
        band: Band = getattr(arm, bands)[measure.name]
        singles = [
            ([x / scale for x in getattr(cell, axis)], cell.curves[measure.name])
            for cell in arm.cells
            if cell.begun
        ]
        own = Series(
            arm.name,
            colour[arm.name],
            [x / scale for x in band.grid],
            band.value,
            band.low,
            band.high,
            singles if len(singles) > 1 else (),
        )
        series.append(pace.scaled(own, measure.name, over_steps=axis == "steps"))
    title = pace.steps if axis == "steps" else title
    return panel(series, capital(pace.titled(titled(measure), measure.name)), title, form)


def _axis(arms: Sequence[ArmFound], axis: str) -> tuple[float, str, Callable[[float], str]]:
    if axis == "steps":
        return 1.0, "training steps", steps
    longest = max(cell.wall[-1] for arm in arms for cell in arm.cells if cell.begun)
    scale, unit = next(
        (scale, unit) for scale, unit in ((3600.0, "h"), (60.0, "min"), (1.0, "s"))
        if longest >= 2.0 * scale or unit == "s"
    )  # fmt: skip
    return scale, f"wall-clock, {unit}", number


def _trained(arm: ArmFound) -> str:
    """Say how many trainings the numbers are of, and what the others are."""
    if arm.complete:
        return f'{arm.done} of {arm.done} <span class="state">{steps(arm.steps)}</span>'
    others: dict[str, int] = {}
    for cell in arm.cells:
        if cell.state != "done":
            kind = cell.state if not cell.state.endswith("%") else "unfinished"
            others[kind] = others.get(kind, 0) + 1
    rest = ", ".join(f"{number} {told(state)}" for state, number in others.items())
    so_far = "" if arm.done else "so far "
    reached = f"{so_far}{steps(arm.steps)}, " if arm.counted else ""
    return f'{arm.done} of {len(arm.cells)} <span class="state">{reached}{rest}</span>'


def _arms(found: Findings, arms: Sequence[ArmFound]) -> str:
    shown = [measure for measure in MEASURES if any(arm.has(measure) for arm in arms)]
    rows = [
        [
            named(found, arm),
            _trained(arm),
            *(in_cell(arm.final[m.name], m) if arm.has(m) else "–" for m in shown),
            *(form_of(m)(arm.before[m.name]) if arm.has(m) else "–" for m in shown[:2]),
        ]
        for arm in arms
    ]
    heads = ["", "done, steps", *(capital(titled(measure)) for measure in shown)]
    heads += [f"{capital(measure.label)} of the zero action" for measure in shown[:2]]
    level = percent(found.settings.confidence)
    return table(heads, rows) + text(
        f"Interquartile mean over seeds with its {level} interval, of the last policies. Falls: "
        "share of the episodes. The velocity error is that of all moments until a robot falls."
    )


def _strips(found: Findings, arms: Sequence[ArmFound]) -> str:
    colour = colours(found)
    charts = []
    for measure in MEASURES:
        rows = [
            Strip(
                arm.name,
                colour[arm.name],
                arm.each[measure.name],
                arm.final[measure.name].value,
                arm.final[measure.name].low,
                arm.final[measure.name].high,
                arm.before[measure.name],
            )
            for arm in arms
            if arm.has(measure)
        ]
        arrow = " (more is better)" if measure.better > 0 else " (less is better)"
        limits = (0.0, 1.0) if measure.unit == "share" else None
        if rows:
            charts.append(strips(rows, capital(titled(measure)) + arrow, form_of(measure), limits))
    return figure(charts, "The same as a picture. Dots: seeds. Diamond: the zero action.")


def _thresholds(found: Findings, arms: Sequence[ArmFound]) -> str:
    timed = [arm for arm in arms if arm.steps_to]
    if not timed:
        return ""

    def reached(kind: str, form: Callable[[float], str]) -> str:
        heads = ["", *(f"{number(value)} m/s" for value in found.settings.thresholds)]
        rows = [
            [named(found, arm), *(_reached(one, form, arm) for one in getattr(arm, kind))]
            for arm in timed
        ]
        return table(heads, rows)

    return (
        heading("Samples and time to a velocity error")
        + text(
            "Training steps until the velocity error is first no larger than this, with "
            f"at least {percent(found.settings.survival)} of the episodes without a fall, "
            "interpolated between evaluations; where too many fell at the one before, the time of "
            "the first that counts. Median over seeds, with its interval, and of how many where "
            "not all got there. A training that never does counts as later than any that does; "
            "from the start: the zero action is as good."
        )
        + reached("steps_to", steps)
        + text("The same in time spent on training, on machines that may have done more besides.")
        + reached("wall_to", _minutes)
    )


def _minutes(seconds: float) -> str:
    return f"{number(seconds / 60, 2)} min"


def _reached(one: Crossing, form: Callable[[float], str], arm: ArmFound) -> str:
    """Write when it was reached, never hiding the trainings that did not get there."""
    total, median = len(one.each), one.median
    so_far = "" if arm.complete else " so far"
    if one.reached == 0:
        return f'<span class="far">not reached{so_far}</span>'
    if max(one.each) <= 0.0:
        return '<span class="far">from the start</span>'
    few = f"{one.reached} of {total}{so_far}" if one.reached < total else ""
    if not math.isfinite(median.value):
        return f'{few} <span class="low">first after {form(min(one.each))}</span>'
    if median.low is None or median.high is None:
        return form(median.value)
    to = form(median.high) if math.isfinite(median.high) else "never"
    return (
        f'{form(median.value)} <span class="low">{form(median.low)} to {to}</span>'
        f'<span class="low">{few}</span>'
    )


def _judged(found: Findings, arms: Sequence[ArmFound]) -> str:
    judged = _against(found, arms, lambda arm: arm.versus)
    if not judged:
        return ""
    return (
        heading(f"How sure is it? Against {found.reference}")
        + text(
            "Probability that a run of the arm does better than a run of the reference (one half: "
            "no difference), and how often shuffling the runs between the two would move it as far "
            "from one half, either way. Where every run of one beats every run of the other the "
            "interval has no width: a limit of resampling so few runs, not certainty."
        )
        + judged
    )


def _against(
    found: Findings,
    arms: Sequence[ArmFound],
    versus_of: Callable[[ArmFound], Mapping[str, Versus]],
) -> str:
    """Return the table of arms against the reference; nothing where none stands against it."""
    shown = [m for m in JUDGED if any(m.name in versus_of(arm) for arm in arms)]
    rows = []
    for arm in arms:
        if arm.name == found.reference:
            continue
        cells = []
        for measure in shown:
            versus = versus_of(arm).get(measure.name)
            cells += ["–", "–"] if versus is None else [
                probability(versus.probability), number(versus.p_value, 2)
            ]  # fmt: skip
        rows.append([named(found, arm), *cells])
    if not shown or not rows:
        return ""
    heads = [""]
    for measure in shown:
        heads += [f"{capital(measure.label)}: does better", "by chance"]
    return table(heads, rows)


def _fresh(found: Findings, arms: Sequence[ArmFound]) -> str:
    played = [(arm, arm.fresh) for arm in arms if arm.fresh is not None]
    if not played:
        return ""
    shown = [m for m in MEASURES if any(m.name in fresh.final for _, fresh in played)]
    rows = [
        [
            named(found, arm),
            f"{len(fresh.runs)} of {len(arm.cells)}",
            str(fresh.falls),
            *(in_cell(fresh.final[m.name], m) if m.name in fresh.final else "–" for m in shown),
        ]
        for arm, fresh in played
    ]
    return (
        heading("In fresh episodes")
        + text(
            "Episodes that neither training nor its evaluations have seen, the same for all: "
            "evaluations are too few to count what befalls one robot in a hundred. Numbers and "
            f"intervals as above, and below them the arms against {escape(found.reference)}."
        )
        + table(["", "trainings", "fell in", *(capital(titled(m)) for m in shown)], rows)
        + _against(found, arms, lambda arm: {} if arm.fresh is None else arm.fresh.versus)
    )


def _clips(clips: Clips, env_id: str) -> str:
    its = [shown for (env, _), shown in clips.items() if env == env_id]
    if not its:
        return ""
    return (
        heading("What it looks like")
        + text("The median seed of each arm, all from the same seed of the environment.")
        + side_by_side(its, env_id)
    )


def _robustness(study: Findings, found: Robustness | None) -> str:
    if found is None:
        return ""
    folds = "".join(
        folded(capital(BY_NAME[along.name].title), figure(panels(found, along, colours(study)), ""))
        for along in found.along
    )
    runs = ", ".join(f"{escape(arm)} {len(its)}" for arm, its in found.runs.items())
    return (
        heading("What they stand that they were not trained for")
        + text(
            "One thing at a time is otherwise than in training: the mean along each factor, of "
            f"{found.budget.episodes} episodes at every value. Runs tried: {runs}."
        )
        + areas(found)
        + folds
    )
