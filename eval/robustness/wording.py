"""Findings in plain words."""

from collections.abc import Sequence

from eval.robustness.curves import Along, Robustness
from eval.robustness.tables import areas
from eval.wording import METRIC, capital, count, percent

LEVEL = ""  # in place of an arm: none is clearly ahead


def leader(along: Along, measure: str) -> str:
    """Return the arm that is clearly ahead along a factor: its interval lies beyond all others'."""
    sign = METRIC[measure].better
    curves = along.curves[measure]
    best, *others = sorted(curves, key=lambda arm: -sign * curves[arm].summary.value)
    ends = {
        arm: sorted(sign * end for end in (its.summary.low, its.summary.high) if end is not None)
        for arm, its in curves.items()
    }
    if not others or not all(map(len, ends.values())):
        return LEVEL
    return best if all(ends[arm][-1] < ends[best][0] for arm in others) else LEVEL


def headline(found: Robustness) -> str:
    """State the finding in one sentence."""
    quantities = areas(found)
    if not quantities:
        factors = [along.name for along in found.along]
        return f"{capital(_joined(list(found.arms)))} along {_joined(factors)}"
    if len(found.arms) == 1:
        (arm,) = found.arms
        share = {one.name: one.curves["survived"][arm].summary.value for one in quantities}
        weakest = min(share, key=lambda name: share[name])
        mean = sum(share.values()) / len(share)
        return (
            f"{capital(arm)} stays up in {percent(mean)} of its episodes, the mean "
            f"along {count(len(share), 'factor')}; least along {weakest}, "
            f"{percent(share[weakest])}."
        )
    return _standing(found, "survived", "stays up more often than all others")


def lede(found: Robustness) -> list[str]:
    """Sentences behind the headline."""
    if len(found.arms) < 2 or not areas(found):
        return []
    _, quality = found.measures
    what = {"velocity_error": "follows its commands best", "returned": "earns most"}[quality]
    return [_standing(found, quality, what)]


def _standing(found: Robustness, measure: str, what: str) -> str:
    """Say along how many factors each arm is ahead, and along which none is."""
    quantities = areas(found)
    led: dict[str, list[str]] = {}
    for along in quantities:
        led.setdefault(leader(along, measure), []).append(along.name)
    level = led.pop(LEVEL, [])
    total = count(len(quantities), "factor")
    if not led:
        return f"Along {total}, no arm clearly {what}."
    order = sorted(led, key=lambda arm: -len(led[arm]))
    parts = [f"{arm} {what} along {_joined(led[arm])}" for arm in order]
    rest = f"; along {_joined(level)} none is clearly ahead" if level else ""
    return f"{capital('; '.join(parts))}{rest}."


def _joined(names: Sequence[str]) -> str:
    if len(names) < 2:
        return "".join(names)
    return f"{', '.join(names[:-1])} and {names[-1]}"
