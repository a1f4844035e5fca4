"""What the sections of a study's page are made of: names, numbers and their colours."""

import math
from collections.abc import Callable
from html import escape

from eval.colours import colours_of_arms
from eval.results import Estimate
from eval.study.results import ERROR, ArmFound, CellFound, Findings, Measure
from eval.wording import interval, number, percent


def colours(found: Findings) -> dict[str, int]:
    """Return the colour of each arm, the same in every environment."""
    return colours_of_arms(arm.name for arm in found.arms)


def titled(measure: Measure) -> str:
    """Return what a measure is called, with its unit."""
    return measure.label + (f", {measure.unit}" if measure.unit not in ("", "share") else "")


def form_of(measure: Measure) -> Callable[[float], str]:
    """Return how values of a measure are written."""
    if measure is ERROR:
        return lambda value: f"{value:.3f}"
    return percent if measure.unit == "share" else number


def latest(cell: CellFound, measure: Measure) -> str:
    """Write a measure of a training's latest evaluation; a dash where it has none."""
    value = cell.curves[measure.name][-1] if cell.begun else math.nan
    return form_of(measure)(value) if math.isfinite(value) else "–"


def named(found: Findings, arm: ArmFound) -> str:
    """Return the name of an arm in its colour, as HTML, with a word where it is the reference."""
    said = " <small>(reference)</small>" if arm.name == found.reference else ""
    return coloured(found, arm.name) + said


def coloured(found: Findings, name: str) -> str:
    """Return the name of an arm in its colour, as HTML."""
    words = escape(name).replace("_", "_<wbr>")
    return f'<span class="layer c{colours(found)[name]}">{words}</span>'


def in_cell(value: Estimate, measure: Measure) -> str:
    """Return an estimate with its interval for a cell of a table, as HTML."""
    form = form_of(measure)
    if value.low is None or value.high is None:
        return form(value.value)
    return f'{form(value.value)} <span class="low">{form(value.low)} to {form(value.high)}</span>'


def probability(value: Estimate) -> str:
    """Write a probability with its interval."""
    return escape(interval(value, lambda one: f"{one:.2f}"))


def told(state: str) -> str:
    """Return the state of a training as HTML."""
    return f'<span class="failed">{escape(state)}</span>' if state == "failed" else escape(state)
