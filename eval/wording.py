"""Format numbers, on pages and in a terminal."""

import math
from collections.abc import Callable

import numpy as np

from eval.results import Estimate
from train.episodes import METRICS, Metric

Form = Callable[[float], str]

METRIC = {metric.name: metric for metric in METRICS}

_WORDS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_NO_BREAK = "\N{NO-BREAK SPACE}"


def number(value: float, digits: int = 3) -> str:
    """Write a number with three significant digits; digits before the point are always kept."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    text = f"{value:,.{min(decimals, 6)}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    return text.replace("-", "−") if text not in ("-0", "") else "0"


def percent(share: float) -> str:
    """Write a share."""
    text = f"{100 * share:.0f}{_NO_BREAK}%"
    return text.replace("-", "−") if math.isfinite(share) else "–"


def steps(count: float) -> str:
    """Write a number of steps."""
    if not math.isfinite(count):
        return "not reached"
    if count >= 1e6:
        return f"{number(count / 1e6)}{_NO_BREAK}M"
    return f"{number(count / 1e3)}{_NO_BREAK}k" if count >= 1e3 else number(count)


def duration(seconds: float) -> str:
    """Write a time."""
    if not math.isfinite(seconds):
        return "not reached"
    if seconds < 99.5:
        text = f"{seconds:.0f} s" if seconds >= 10 else f"{number(seconds, 2)} s"
    elif seconds < 3599.5:
        minutes, rest = divmod(round(seconds), 60)
        text = f"{minutes} min {rest} s" if rest else f"{minutes} min"
    else:
        text = f"{round(seconds / 60) // 60} h {round(seconds / 60) % 60} min"
    return text.replace(" ", _NO_BREAK)


def count(value: int, noun: str) -> str:
    """Write a small number in words, with its noun."""
    word = _WORDS[value] if value < len(_WORDS) else str(value)
    return f"{word} {noun}{'' if value == 1 else 's'}"


def titled(metric: Metric) -> str:
    """Return the name of a metric, with its unit; errors in m are written in mm."""
    unit = "mm" if _in_mm(metric) else metric.unit
    return metric.label + (f", {unit}" if unit not in ("", "share") else "")


def form_of(metric: Metric) -> Form:
    """Return how values of a metric are written."""
    if metric.unit == "share":
        return percent
    if metric.unit == "m/s":
        return _three_decimals
    return (lambda value: number(1e3 * value)) if _in_mm(metric) else number


def _three_decimals(value: float) -> str:
    """Write with three decimals, without a sign where these are zero."""
    text = f"{round(value, 3) + 0.0:.3f}".replace("-", "−")
    return text if math.isfinite(value) else "–"


def _in_mm(metric: Metric) -> bool:
    return metric.unit == "m" and metric.better < 0


def interval(estimate: Estimate, form: Form = number) -> str:
    """Write "value (low to high)", or the value alone where there is no interval."""
    if estimate.low is None or estimate.high is None:
        return form(estimate.value)
    return f"{form(estimate.value)} ({span(estimate, form)})"


def span(estimate: Estimate, form: Form = number) -> str:
    """Write the interval alone, as "low to high" that stays on one line."""
    low, high = (math.nan if end is None else end for end in (estimate.low, estimate.high))
    return f"{form(low)} to {form(high)}".replace(" ", _NO_BREAK)


def over_seeds(values: np.ndarray, form: Form) -> str:
    """Write the mean over seeds (S,), and their range where there are several."""
    spread = f" ({form(values.min())} to {form(values.max())})" if len(values) > 1 else ""
    return form(values.mean()) + spread


def capital(text: str) -> str:
    """Begin with a capital."""
    return text[:1].upper() + text[1:]
