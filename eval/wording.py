"""A comparison in plain words: what was found, how sure one can be, and how numbers are written."""

import math
from collections.abc import Callable, Sequence

from eval import statistics as st
from eval.results import Comparison, Crossing, Estimate, Layer, Pair

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
    return f"{100 * share:.0f}{_NO_BREAK}%" if math.isfinite(share) else "–"


def rare(share: float) -> str:
    """Write a share of which "0 %" would say too much."""
    return f"fewer than {percent(0.01)}" if share < 0.005 else percent(share)


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


def interval(estimate: Estimate, form: Callable[[float], str] = number) -> str:
    """Write "value (low to high)", or the value alone where there is no interval."""
    if estimate.low is None or estimate.high is None:
        return form(estimate.value)
    return f"{form(estimate.value)} ({form(estimate.low)} to {form(estimate.high)})"


def capital(text: str) -> str:
    """Begin with a capital."""
    return text[:1].upper() + text[1:]


def headline(comparison: Comparison) -> str:
    """State the finding in one sentence, with how far it can be trusted."""
    first = comparison.layers[0]
    if not comparison.pairs:
        earned = number(first.metrics["returned"].value)
        return (
            f"{capital(first.name)} reaches a return of {earned} over {count(first.seeds, 'seed')}."
        )
    second = comparison.layers[1]
    pair = comparison.pairs[0]
    margin = f"{number(pair.difference.value)} points of return"
    if min(first.seeds, second.seeds) < 2:
        return (
            f"{capital(first.name)} ended {margin} above {second.name}, but one run cannot say "
            "whether the next would."
        )
    if not clearly_ahead(pair):
        return (
            f"No clear difference: {first.name} and {second.name} end {margin} apart, which is "
            "within the scatter of their seeds."
        )
    if pair.p_value <= 1 - comparison.settings.confidence:
        low, high = number(pair.difference.low or 0.0), number(pair.difference.high or 0.0)
        return (
            f"{capital(first.name)} ends {margin} above {second.name}, more than chance explains "
            f"({percent(comparison.settings.confidence)} interval {low} to {high})."
        )
    who = (
        f"Every seed of {first.name} ended above every seed of {second.name}"
        if pair.probability.value == 1
        else f"{capital(first.name)} ended above {second.name}"
    )
    return (
        f"{who}, by {margin}, but {count(first.seeds, 'seed')} against "
        f"{count(second.seeds, 'seed').split()[0]} cannot rule out chance."
    )


def clearly_ahead(pair: Pair) -> bool:
    """Whether the interval of the difference leaves zero out."""
    return pair.difference.low is not None and pair.difference.low > 0


def lede(comparison: Comparison) -> list[str]:
    """Sentences that give the numbers behind the headline."""
    layers = comparison.layers
    level = percent(comparison.settings.confidence)
    known = f", interquartile mean over seeds with its {level} interval" if _several(layers) else ""
    finals = "; ".join(f"{x.name} {interval(x.metrics['returned'])}" for x in layers)
    most = comparison.most
    limit = f", of at most {number(most)}" if math.isfinite(most) else ""
    sentences = [f"Return at the end{limit}{known}: {finals}."]
    if comparison.pairs:
        pair = comparison.pairs[0]
        pairings = layers[0].seeds * layers[1].seeds
        sentences.append(
            f"{capital(pair.better)} wins {number(pair.probability.value * pairings)} of "
            f"{pairings} pairings of its runs with those of {pair.other}. If the layer did not "
            f"matter, a score this lopsided would still turn up in {rare(pair.p_value)} of "
            "comparisons."
        )
    if comparison.threshold is not None:
        times = "; ".join(
            f"{x.name} {crossing(x.steps_to, steps)}" for x in layers if x.steps_to is not None
        )
        sentences.append(f"Training steps to a return of {number(comparison.threshold)}: {times}.")
    zero = "; ".join(f"{x.name} {number(x.zero_action['returned'])}, {_gain(x)}" for x in layers)
    sentences.append(f"Without a policy, zero action alone returns: {zero}.")
    return sentences


def caution(comparison: Comparison) -> str | None:
    """Say what so few seeds cannot say; None from five seeds a layer on."""
    fewest = comparison.fewest_seeds
    if fewest >= 5:
        return None
    level = percent(comparison.settings.confidence)
    if fewest < 2:
        return (
            "One seed is one draw. It shows that this can happen, not how often, so there are no "
            "intervals here. Train at least five seeds a layer before believing a difference."
        )
    text = (
        f"With {count(fewest, 'seed')} a layer, an interval called {level} is no more than the "
        f"range from the worst to the best seed, and holds the true median at most "
        f"{percent(st.coverage_ceiling(fewest))} of the time."
    )
    separated = 2 / math.comb(2 * fewest, fewest)
    return text + (
        f" Two identical layers would come out fully separated, every seed of one above every seed "
        f"of the other, in {percent(separated)} of such comparisons. Train at least five seeds a "
        "layer before believing a difference."
    )


def crossing(value: Crossing | None, form: Callable[[float], str]) -> str:
    """Write when the threshold was reached, never hiding the runs that did not reach it."""
    if value is None:
        return "–"
    total = len(value.each)
    if value.reached == 0:
        return f"not reached in {total} runs" if total > 1 else "not reached"
    if max(value.each) <= 0:
        return "reached before training"
    if not math.isfinite(value.median.value):
        return f"reached in {value.reached} of {total} runs, first after {form(min(value.each))}"
    missing = (
        "" if value.reached == total else f", not reached in {total - value.reached} of {total}"
    )
    return f"{interval(value.median, form)}{missing}"


def _gain(layer: Layer) -> str:
    """What training made of the layer; it can also make it worse."""
    gain = layer.metrics["returned"].value - layer.zero_action["returned"]
    if gain < 0:
        return f"from which training takes {number(-gain)}"
    return f"to which training adds {number(gain)}"


def _several(layers: Sequence[Layer]) -> bool:
    """Whether any layer has an interval."""
    return any(layer.seeds > 1 for layer in layers)
