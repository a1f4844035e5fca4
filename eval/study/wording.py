"""What a study found, in plain words."""

from collections.abc import Sequence

from eval.study.results import ERROR, FALLS, RETURN, ArmFound, Findings, Measure
from eval.wording import interval, number, percent
from train.runs.study import environment_name


def standing(found: Findings) -> str:
    """Say how much of the study is done."""
    cells = [cell for arm in found.arms for cell in arm.cells]
    done = sum(cell.state == "done" for cell in cells)
    failed = sum(cell.state == "failed" for cell in cells)
    if done == len(cells):
        return f"All {done} trainings have finished."
    rest = f"; {failed} failed" if failed else ""
    return f"{done} of {len(cells)} trainings have finished{rest}."


def lede(found: Findings) -> list[str]:
    """Sentences with what each environment came to, of arms of which something is done."""
    sentences = []
    for env_id, arms in found.environments().items():
        name = environment_name(env_id)
        sentences += [_of(name, arms, found.reference), _falls(name, arms)]
    return list(filter(None, sentences))


def _falls(name: str, arms: Sequence[ArmFound]) -> str:
    parts = [f"{arm.name} {arm.fresh.falls}" for arm in arms if arm.fresh is not None]
    return f"{name}, falls in fresh episodes: {'; '.join(parts)}." if parts else ""


def _of(name: str, arms: Sequence[ArmFound], reference: str) -> str:
    measure = ERROR if any(arm.done and arm.has(ERROR) for arm in arms) else RETURN
    known = [arm for arm in arms if arm.done and arm.has(measure)]
    if not known:
        return ""
    order = sorted(known, key=lambda arm: -measure.better * arm.final[measure.name].value)
    parts = [f"{arm.name} {_value(arm, measure)}" for arm in order]
    what = "velocity error in m/s" if measure is ERROR else "return"
    said = f"{name}, {what} at the end: {'; '.join(parts)}."
    best = order[0]
    versus = best.versus.get(measure.name)
    if versus is None:
        return said
    if versus.probability.value == 1.0:
        return f"{said} Every run of {best.name} does better than every run of {reference}."
    return (
        f"{said} A run of {best.name} does better than one of {reference} with probability "
        f"{interval(versus.probability, lambda one: f'{one:.2f}')}."
    )


def _value(arm: ArmFound, measure: Measure) -> str:
    form = (lambda one: f"{one:.3f}") if measure is ERROR else number
    said = interval(arm.final[measure.name], form)
    falls = arm.final.get(FALLS.name)
    fallen = f", falling in {percent(falls.value)}" if falls and falls.value >= 0.005 else ""
    return said + fallen
