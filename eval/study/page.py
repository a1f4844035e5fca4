"""The report of a study as one self-contained HTML page."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from eval.clips import legend
from eval.page.figures import Series, Strip, colours_of, panel, strips
from eval.page.html import STARTS, render
from eval.results import Band, Crossing
from eval.robustness.curves import CONFIDENCE, Robustness
from eval.robustness.page import factors
from eval.robustness.tables import means
from eval.statistics import coverage_ceiling
from eval.study.films import Clips
from eval.study.pace import Pace
from eval.study.results import (
    CURVES,
    ERROR,
    JUDGED,
    MEASURES,
    RETURN,
    ArmFound,
    Findings,
    Fresh,
    Measure,
    Versus,
)
from eval.wording import Form, capital, number, percent, span, steps


def page(
    found: Findings,
    clips: Clips | None = None,
    robustness: Mapping[str, Robustness] | None = None,
    command: str = "",
) -> str:
    """Lay out the page, with clips and robustness of the environments where there are any.

    It shows the command line that made it.
    """
    colours = colours_of(arm.name for arm in found.arms)
    clips, robustness = clips or {}, robustness or {}
    cells = [cell for arm in found.arms for cell in arm.cells]
    across = [m for m in JUDGED if any(m.name in arm.probability for arm in found.across)]
    return render(
        "study.html",
        title=found.title,
        script=STARTS if clips else "",
        found=found,
        cells=cells,
        colours=colours,
        environments=[
            _environment(found, env_id, arms, clips, robustness.get(env_id), colours)
            for env_id, arms in found.environments().items()
        ],
        across=across,
        across_heads=[f"{capital(measure.label)}: does better" for measure in across],
        thresholds=[f"{number(value)} m/s" for value in found.settings.thresholds],
        measures=[m for m in MEASURES if any(arm.has(m) for arm in found.arms)],
        seeds=min((len(arm.counted) for arm in found.arms if arm.cells and arm.counted), default=5),
        ceiling=coverage_ceiling,
        chance=lambda seeds: 2.0 / math.comb(2 * seeds, seeds),
        trained=_trained,
        reached=_reached,
        to_two="{:.2f}".format,
        to_three="{:.3f}".format,
        commands="\n".join(filter(None, [*(cell.command for cell in cells), command])),
    )


def _environment(
    found: Findings,
    env_id: str,
    arms: Sequence[ArmFound],
    clips: Clips,
    robustness: Robustness | None,
    colours: Mapping[str, int],
) -> dict[str, Any]:
    """Return what the section of an environment is made of."""
    measured = [arm for arm in arms if (arm.final if arm.policy else arm.counted)]
    known = [m for m in MEASURES if any(arm.has(m) for arm in arms)]
    played = [arm for arm in arms if arm.fresh is not None]
    fresh = [m for m in MEASURES if any(m.name in a.fresh.final for a in played if a.fresh)]
    return {
        "id": env_id,
        "arms": arms,
        "ranked": _ranked(arms),
        "measured": measured,
        "curves": _curves(measured, colours),
        "known": known,
        "befores": [f"{capital(measure.label)} of the zero action" for measure in known[:2]],
        "strips": [_strips([(arm, arm) for arm in measured], m, colours) for m in known],
        "timed": [arm for arm in measured if arm.steps_to],
        "level": found.levels.get(env_id),
        "levelled": [arm for arm in measured if arm.level_to],
        "unlearnt": [arm for arm in measured if arm.policy],
        "judged": _against(arms, lambda arm: arm.versus),
        "played": played,
        "fresh": fresh,
        "fresh_strips": [
            _strips([(arm, arm.fresh) for arm in played if arm.fresh], m, colours) for m in fresh
        ],
        "fresh_judged": _against(played, lambda arm: arm.fresh.versus if arm.fresh else {}),
        "clips": [shown for (env, _), shown in clips.items() if env == env_id],
        "drawn": legend(env_id),
        "robustness": robustness,
        "areas": [] if robustness is None else means(robustness),
        "confidence": percent(CONFIDENCE),
        "factors": [] if robustness is None else factors(robustness, colours),
    }


def _curves(arms: Sequence[ArmFound], colours: Mapping[str, int]) -> list[Markup]:
    drawn = []
    for measure in CURVES:
        for axis in ("steps", "wall"):
            its = [arm for arm in arms if measure.name in getattr(arm, f"by_{axis}")]
            if its:
                its += [arm for arm in arms if arm.policy and arm.has(measure)]
                drawn.append(_panel(its, measure, axis, colours))
    return drawn


def _panel(
    arms: Sequence[ArmFound], measure: Measure, axis: str, colours: Mapping[str, int]
) -> Markup:
    pace, over_steps = Pace.of((arm.name, arm.most) for arm in arms), axis == "steps"
    scale, x_title, form = (1.0, pace.steps, steps) if over_steps else _clock(arms)
    series: list[Series] = []
    for arm in arms:
        if arm.policy:
            longest = max(float(np.max(one.x)) for one in series)
            its = arm.final[measure.name]
            level = Series.constant(arm.name, colours[arm.name], longest, its)
            series.append(pace.scaled(level, measure.name, over_steps=False))
            continue
        begun = [cell for cell in arm.cells if cell.begun]
        thin = [(np.array(getattr(cell, axis)) / scale, cell.curves[measure.name])
                for cell in begun if len(begun) > 1]  # fmt: skip
        band: Band = getattr(arm, f"by_{axis}")[measure.name]
        x, edges = np.array(band.grid) / scale, (band.low, band.high)
        own = Series(arm.name, colours[arm.name], x, band.value, *edges, thin)
        series.append(pace.scaled(own, measure.name, over_steps=over_steps))
    label = capital(pace.titled(measure.label, measure.name))
    title = f"{label} over {'steps' if over_steps else 'time'}"
    unit = f", {measure.unit}" if measure.unit else ""
    return panel(series, title + unit, x_title, form)


def _clock(arms: Sequence[ArmFound]) -> tuple[float, str, Form]:
    longest = max(cell.wall[-1] for arm in arms for cell in arm.cells if cell.begun)
    units = ((3600.0, "h"), (60.0, "min"), (1.0, "s"))
    scale, unit = next((s, u) for s, u in units if longest >= 2.0 * s or u == "s")
    return scale, f"wall-clock, {unit}", number


def _strips(
    rows: Sequence[tuple[ArmFound, ArmFound | Fresh]], measure: Measure, colours: Mapping[str, int]
) -> Markup:
    """Draw what arms come to, each with where its numbers are."""
    name = measure.name
    return strips([
        Strip(arm.name, colours[arm.name], its.each[name], its.final[name],
              its.before.get(name, math.nan) if isinstance(its, ArmFound) else math.nan)
        for arm, its in rows if name in its.final and math.isfinite(its.final[name].value)
    ], measure)  # fmt: skip


def _against(
    arms: Sequence[ArmFound], versus_of: Callable[[ArmFound], Mapping[str, Versus]]
) -> dict[str, Any]:
    """Return in what arms are set against the reference, and how; empty where none is."""
    others = [(arm, its) for arm in arms if (its := versus_of(arm))]
    shown = [m for m in JUDGED if any(m.name in versus for _, versus in others)]
    heads = [(f"{capital(measure.label)}: does better", "p") for measure in shown]
    return {"measures": shown, "heads": ["", *sum(heads, ())], "rows": others} if shown else {}


def _trained(arm: ArmFound) -> str:
    """Say after how many steps the numbers are, and how the unfinished trainings stand."""
    if arm.policy:
        return "evaluated" if arm.final else "" if arm.fresh else "not played: --fresh-episodes"
    if arm.complete:
        return steps(arm.steps)
    states = [cell.state for cell in arm.cells if cell.state != "done"]
    others = Counter("unfinished" if state.endswith("%") else state for state in states)
    rest = ", ".join(f"{count} {state}" for state, count in others.items())
    so_far = "" if arm.done else "so far "
    return f"{so_far}{steps(arm.steps)}, {rest}" if arm.counted else rest


def _reached(one: Crossing, form: Form, arm: ArmFound) -> tuple[str, ...]:
    """Write when it was reached, and what belongs below, never hiding who did not get there."""
    total, median = len(one.each), one.median
    so_far = "" if arm.complete else " so far"
    if one.reached == 0:
        return "", f"not reached{so_far}"
    if max(one.each) <= 0.0:
        return "", "from the start"
    few = f"{one.reached} of {total}{so_far}" if one.reached < total else ""
    if not math.isfinite(median.value):
        return few, f"first after {form(min(one.each))}"
    if median.low is None:
        return (form(median.value),)
    return form(median.value), span(median, lambda x: form(x) if math.isfinite(x) else "never"), few


def _ranked(arms: Sequence[ArmFound]) -> tuple[Measure, list[ArmFound]]:
    """Return what arms are ranked by, and those at their end, best first; none if none learnt."""
    measure = ERROR if any(arm.done and arm.has(ERROR) for arm in arms) else RETURN
    known = [arm for arm in arms if arm.ready and arm.has(measure)]
    order = sorted(known, key=lambda arm: -measure.better * arm.final[measure.name].value)
    return measure, order if any(arm.done for arm in known) else []
