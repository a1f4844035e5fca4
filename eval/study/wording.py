"""Finding about the arms of one environment, in one sentence."""

from collections.abc import Sequence

import numpy as np

from eval.robustness.curves import Robustness
from eval.study.findings import set_against
from eval.study.results import ERROR, RETURN, ArmFound, Findings, Fresh
from eval.wording import capital, count, form_of, number, percent


def headline(found: Findings, stood: Robustness | None = None) -> str:
    """State which of the two best that learnt did better in fresh episodes, and how sure that is.

    By how much is told in the units of the task, and by what they stood under pushes.
    """
    ranked = [(arm, arm.fresh) for arm in found.arms if arm.cells and arm.fresh is not None]
    ranked.sort(key=lambda both: -both[1].final[RETURN.name].value)
    best, said = ranked[:2], ""
    if len(best) == 1:
        ((arm, fresh),) = best
        said = f"{capital(arm.name)} over {count(len(fresh.runs), 'seed')}"
    else:
        said = _claim(found, best)
    return f"{said}: {_numbers(best, stood)}."


def _claim(found: Findings, best: Sequence[tuple[ArmFound, Fresh]]) -> str:
    (first, its), (second, others) = best
    one, other = capital(first.name), second.name
    if min(len(its.runs), len(others.runs)) < 2:
        return f"{one} ended above {other}, but one run cannot say whether the next would"
    chance = found.settings.chance()
    sure = set_against(its.each, others.each, (first.most, second.most), chance)[RETURN.name]
    if sure.probability.low is None or sure.probability.low <= 0.5:
        return f"No clear difference in return between {first.name} and {other}"
    if sure.p_value <= 1.0 - found.settings.confidence:
        return f"{one} returns more than {other} (p = {number(sure.p_value, 2)})"
    said = f"{one} returned more than {other}"
    if sure.probability.value == 1.0:
        said = f"Every seed of {first.name} returns more than every seed of {other}"
    against = count(len(others.runs), "seed").split()[0]
    return f"{said}, but {count(len(its.runs), 'seed')} against {against} cannot rule out chance"


def _numbers(best: Sequence[tuple[ArmFound, Fresh]], stood: Robustness | None) -> str:
    parts = []
    for measure in (RETURN, ERROR):
        if all(measure.name in fresh.final for _, fresh in best):
            values = [form_of(measure)(fresh.final[measure.name].value) for _, fresh in best]
            parts.append(f"{measure.label} {' against '.join(values)} {measure.unit}".strip())
    said = "; ".join(parts)
    if stood is None:
        return said
    along = stood.along[0]
    curves = [along.curves["survived"][arm.name] for arm, _ in best]
    shares = np.array([[point.value for point in curve.points] for curve in curves])
    differ = np.ptp(shares, axis=0)
    at = int(np.argmax(differ)) if differ.any() else -1
    up = " against ".join(percent(share) for share in shares[:, at])
    most = ", where they differ most" if differ.any() and len(shares[0]) > 1 else ""
    size = number(along.values[at])
    return f"{said}; {up} stay up under pushes of {size} times their weight{most}"
