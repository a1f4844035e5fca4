"""Collect the results of a study's run folders.

The unit of chance is the run. Its numbers are those of its latest evaluation in training: the last
policy, on episodes that no choice was made by, the same for every run. The first evaluation is the
zero action, which is what a policy begins with. A policy that learns nothing has no runs: its
chance is that of episodes, and it is set against runs by the same fresh episodes.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from eval import statistics as st
from eval.comparable import origin_warnings
from eval.results import Band, Crossing, Estimate, greatest_return
from eval.statistics import Chance
from eval.study import fresh
from eval.study.cells import fallen
from eval.study.fresh import OF_EPISODES, Falls, Played
from eval.study.results import (
    CURVES,
    ERROR,
    FALLS,
    JUDGED,
    MEASURES,
    RETURN,
    Across,
    Answer,
    ArmFound,
    CellFound,
    Findings,
    Fresh,
    Level,
    Measure,
    Settings,
    Values,
    Versus,
)
from fbid_gym.checks import check_choices
from train.runs.command_line import command
from train.runs.differences import made_with
from train.runs.environment import changed_meaning
from train.runs.files import read_json
from train.runs.folder import RunFolder
from train.runs.reading import layer_name, read_columns
from train.runs.study import Arm, Study, arms, check_cells
from train.runs.training import Status, standing


def findings(study: Study, settings: Settings, reference: str | None = None) -> Findings:
    """Read the run folders of a study and put them together, arms set against the reference.

    Raises:
        RunError: a run folder of another training, or a file in one that cannot be read.
        UnknownOptionError: no arm has the name of the reference.
    """
    check_cells(study)
    reference = checked_reference(study, reference)
    (played, outdated), evaluated = fresh.kept(study), fresh.levels(study)
    folders = [RunFolder.of(cell.config.folder) for cell in study.cells]
    versions = [read_json(folder.versions) for folder in folders if folder.versions.is_file()]
    warnings = [*_changed(study), *origin_warnings([made_with(its) for its in versions]), *outdated]
    known, its = versions[0] if versions else {}, [_begun(arm) for arm in arms(study)]
    bare = Findings(study.name, study.title, reference, settings, its, warnings, known)
    found = together(bare, played, evaluated)
    return replace(found, answers=_answers(study, found.arms, played, settings.chance()))


def together(
    bare: Findings, played: Mapping[str, Played], evaluated: Mapping[str, Played]
) -> Findings:
    """Put the runs of each arm together, and set the arms against the reference.

    Args:
        bare: the arms, with their cells alone.
        played: what runs did in fresh episodes, by name.
        evaluated: likewise what learns nothing, in the episodes that trainings are evaluated in.
    """
    chance = bare.settings.chance()
    found = [
        _unlearnt(arm, evaluated, chance) if arm.policy else _arm(arm, bare.settings, chance)
        for arm in bare.arms
    ]
    levels = {arm.env_id: level for arm in found if (level := _level(arm.env_id, found))}
    found = [_with_level(_with_fresh(arm, played, chance), levels, chance) for arm in found]
    references = {arm.env_id: arm for arm in found if arm.name == bare.reference}
    for arm in found:
        other = references.get(arm.env_id)
        if other is None or other is arm:
            continue
        most, learnt = (arm.most, other.most), not (arm.policy or other.policy)
        if learnt and arm.done and other.done:
            arm.versus.update(set_against(arm.each, other.each, most, chance))
        if arm.fresh is not None and other.fresh is not None:
            test = None if learnt else partial(_paired, (arm, other), played, chance)
            its = set_against(arm.fresh.each, other.fresh.each, most, chance, test)
            arm.fresh.versus.update(its)
    across = _across(found, references, chance)
    return replace(bare, arms=found, across=across, levels=levels)


def _answers(
    study: Study, found: Sequence[ArmFound], played: Mapping[str, Played], chance: Chance
) -> list[Answer]:
    """Return what came of the endpoints of which both arms are done; p is corrected for all."""
    arms_by_name = {(arm.env_id, arm.name): arm for arm in found}
    answers = []
    for asked in study.endpoints:
        pair = [arms_by_name[asked.env, name] for name in (asked.arm, asked.against)]
        measure = next(measure for measure in MEASURES if measure.name == asked.measure)
        sides = [arm.fresh.each if arm.fresh else {} for arm in pair]
        fresh_of_both = all(_has(side, measure) for side in sides)
        if not fresh_of_both:
            sides = [arm.each for arm in pair]
        if not all(
            arm.ready and _has(side, measure) for arm, side in zip(pair, sides, strict=True)
        ):
            continue
        x, y = (np.array(side[measure.name]) for side in sides)
        unlearnt = any(arm.policy for arm in pair)
        if unlearnt:
            known = _paired(pair, played, chance, measure)
        else:
            each = _by_episodes(pair, played, measure) if fresh_of_both else None
            apart = (
                st.difference(x, y, chance)
                if each is None
                else st.difference_over_episodes(*each, chance)
            )
            known = apart, st.p_value(x, y, chance.rng)
        if known is not None:
            means, which = (float(x.mean()), float(y.mean())), (asked.env, asked.arm, asked.against)
            its = Answer(
                *which, measure, fresh_of_both, means, unlearnt, *known, corrected=known[1]
            )
            answers.append(its)
    # Those that are not known yet count, too: with p = 1.
    unknown = [1.0] * (len(study.endpoints) - len(answers))
    corrected = st.holm([answer.p_value for answer in answers] + unknown)
    return [replace(each, corrected=p) for each, p in zip(answers, corrected, strict=False)]


def _by_episodes(
    pair: Sequence[ArmFound], played: Mapping[str, Played], measure: Measure
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return what two arms came to in their fresh episodes, (R, E) or (E,) of what learns nothing.

    Of returns the shares of what can be earned, where one learns nothing and they decide at
    different rates. None where the two have not played as many episodes, or what each came to was
    not kept.
    """
    sides, unlearnt = [], any(its.policy for its in pair)
    for its in pair:
        each = [played[run].each for run in its.fresh.runs] if its.fresh is not None else []
        values = [measure.of(columns) for columns in each if columns]
        if not values or len(values) < len(each):
            return None
        shares = unlearnt and measure is RETURN and np.isfinite(its.most)
        per = its.most / pair[1].most if shares else 1.0
        sides.append((values[0] if its.policy else np.array(values)) / per)
    one, other = sides
    return None if one.shape[-1] != other.shape[-1] else (one, other)


def _paired(
    pair: Sequence[ArmFound], played: Mapping[str, Played], chance: Chance, measure: Measure
) -> tuple[Estimate, float] | None:
    """Set two arms of which one learns nothing against each other by their fresh episodes."""
    each = _by_episodes(pair, played, measure)
    return None if each is None else st.paired(*each, chance.confidence)


def checked_reference(study: Study, reference: str | None) -> str:
    """Return the arm that others are set against, which has to be one; None: the study's."""
    names = dict.fromkeys(arm.name for arm in arms(study))
    check_choices("reference", () if reference is None else (reference,), names)
    return study.reference if reference is None else reference


def _begun(arm: Arm) -> ArmFound:
    cells, first = [cell.config for cell in arm.cells], arm.cells[0].config
    layer, most = layer_name(first.make_args()), greatest_return(first.env, first.make_args())
    if arm.policy:
        return ArmFound(arm.env, arm.name, layer, most, [], [first.folder.name], arm.policy)
    found = [cell_found(c.folder, c.folder.name, c.seed, standing(c), command(c)) for c in cells]
    return ArmFound(arm.env, arm.name, layer, most, found)


def cell_found(folder: Path, name: str, seed: int | None, where: Status, again: str) -> CellFound:
    """Read what evaluations found of a training; `again` is the command that trains it."""
    table = read_columns(RunFolder.of(folder).evaluations)
    return CellFound(
        *(name, seed, where.state, where.note),
        table["steps"].tolist() if table else [],
        table.get("wall_seconds", table["steps"] * np.nan).tolist() if table else [],
        fallen(folder, table["steps"]).tolist() if table else [],
        {measure.name: measure.of(table).tolist() for measure in MEASURES} if table else {},
        again,
    )


def _arm(arm: ArmFound, settings: Settings, chance: Chance) -> ArmFound:
    begun = [cell for cell in arm.cells if cell.begun]
    counted = [cell for cell in begun if cell.state == "done"] or begun
    until = min((cell.steps[-1] for cell in counted), default=0.0)
    each = {m.name: [cell.at(m.name, until) for cell in counted] for m in MEASURES if counted}
    known = [measure for measure in MEASURES if _has(each, measure)]
    timed = settings.thresholds if ERROR in known else ()
    known_falls = all(np.isfinite(cell.fallen).all() for cell in counted)
    return replace(
        arm,
        counted=[cell.name for cell in counted],
        steps=until,
        before={m.name: float(np.mean([c.curves[m.name][0] for c in counted])) for m in known},
        each=each,
        final=_final(each, known, chance),
        by_steps={m.name: _band(counted, "steps", m, chance) for m in CURVES if m in known},
        by_wall={m.name: _band(counted, "wall", m, chance) for m in CURVES if m in known},
        steps_to=[_crossing(counted, "steps", value, settings, chance) for value in timed],
        wall_to=[_crossing(counted, "wall", value, settings, chance) for value in timed],
        falls_to=[_crossing(counted, "fallen", value, settings, chance)
                  for value in timed if known_falls],
    )  # fmt: skip


def _unlearnt(arm: ArmFound, evaluated: Mapping[str, Played], chance: Chance) -> ArmFound:
    """Return an arm that learns nothing, by what it did in evaluations of trainings."""
    its = evaluated.get(arm.counted[0])
    found = {} if its is None else _over_episodes(its, chance)
    final = {name: known for name, known in found.items() if name not in OF_EPISODES}
    return replace(arm, final=final, each={name: [known.value] for name, known in final.items()})


def _over_episodes(its: Played, chance: Chance) -> dict[str, Estimate]:
    """Return the means of the episodes of one policy, with intervals over them."""
    found = {}
    for measure in MEASURES:
        mean, each = measure.of(its.means).item(), measure.of(its.each) if its.each else None
        if np.isfinite(mean):
            over = Estimate(mean) if each is None else chance.estimate([each], np.mean)
            found[measure.name] = replace(over, value=mean)
    return found


def _level(env_id: str, found: Sequence[ArmFound]) -> Level | None:
    """Return the best policy without learning of an environment; None where there is none."""
    its = [arm for arm in found if arm.env_id == env_id and arm.policy and arm.has(RETURN)]
    levels = [Level(arm.name, float(_scores(arm.each, RETURN, arm.most)[0])) for arm in its]
    return max(levels, key=lambda level: level.share, default=None)


def _with_level(arm: ArmFound, levels: Mapping[str, Level], chance: Chance) -> ArmFound:
    cells = [cell for cell in arm.cells if cell.name in arm.counted]
    if not cells or arm.env_id not in levels or not arm.has(RETURN):
        return arm
    level_to, share = {}, levels[arm.env_id].share
    curves = [(cell, _scores(cell.curves, RETURN, arm.most)) for cell in cells]
    for axis in ("steps", "wall", "fallen"):
        each = [st.first_crossing(getattr(cell, axis), its, share) for cell, its in curves]
        if not np.isnan(each).any():
            level_to[axis] = st.crossing(np.array(each), chance)
    return replace(arm, level_to=level_to)


def _band(cells: Sequence[CellFound], axis: str, measure: Measure, chance: Chance) -> Band:
    x = [getattr(cell, axis) for cell in cells]
    return st.band(x, [cell.curves[measure.name] for cell in cells], chance)


def _crossing(
    cells: Sequence[CellFound], axis: str, error: float, settings: Settings, chance: Chance
) -> Crossing:
    """Steps after which the runs first err no more than that, and stay up often enough.

    Interpolated between evaluations; from one at which too many fall it is not.
    """
    each = []
    for cell in cells:
        upright = 1.0 - np.array(cell.curves[FALLS.name]) >= settings.survival
        errors = np.where(upright, cell.curves[ERROR.name], np.inf)
        each.append(st.first_crossing(getattr(cell, axis), -errors, -error))
    return st.crossing(np.array(each), chance)


def _with_fresh(arm: ArmFound, played: Mapping[str, Played], chance: Chance) -> ArmFound:
    names = arm.counted if arm.policy else [cell.name for cell in arm.cells]
    runs = [name for name in names if name in played]
    if not runs:
        return arm
    each = {m.name: [m.of(played[name].means).item() for name in runs] for m in MEASURES}
    final = _final(each, [measure for measure in MEASURES if _has(each, measure)], chance)
    if arm.policy:
        final = _over_episodes(played[runs[0]], chance)
    return replace(arm, fresh=Fresh(runs, Falls.of([played[name] for name in runs]), each, final))


def _has(each: Values, measure: Measure) -> bool:
    """Whether all runs have it."""
    return measure.name in each and bool(np.isfinite(each[measure.name]).all())


def _final(each: Values, known: Sequence[Measure], chance: Chance) -> dict[str, Estimate]:
    return {m.name: st.estimate(np.array(each[m.name]), chance) for m in known}


def _scores(each: Values, measure: Measure, most: float) -> np.ndarray:
    """Return the compared numbers, more is better; of returns the share of the greatest.

    Arms that decide at different rates add up different numbers of rewards.
    """
    values = measure.better * np.array(each[measure.name])
    return values / most if measure is RETURN and np.isfinite(most) else values


def set_against(
    each: Values,
    others: Values,
    most: tuple[float, float],
    chance: Chance,
    test: Callable[[Measure], tuple[Estimate, float] | None] | None = None,
) -> dict[str, Versus]:
    """Set an arm against another; p is that of runs, or what `test` says, and may not be known."""
    found = {}
    for measure in (m for m in JUDGED if _has(each, m) and _has(others, m)):
        x, y = (_scores(*side) for side in ((each, measure, most[0]), (others, measure, most[1])))
        known = test(measure) if test else (None, st.p_value(x, y, chance.rng))
        if known is not None:
            found[measure.name] = Versus(st.improvement([x], [y], chance), known[1])
    return found


def _across(
    found: Sequence[ArmFound], references: dict[str, ArmFound], chance: Chance
) -> list[Across]:
    """Return the arms that more than one environment has beside the reference."""
    by_name: dict[str, list[ArmFound]] = {}
    for arm in found:
        if arm.ready and arm.env_id in references and references[arm.env_id].ready:
            by_name.setdefault(arm.name, []).append(arm)
    across = []
    for name, its in by_name.items():
        if len(its) < 2:
            continue
        others = [references[arm.env_id] for arm in its]
        shares = [np.array(arm.each[RETURN.name]) / arm.most for arm in its]
        probability = {}
        for measure in JUDGED if its[0] is not others[0] else ():
            if all(arm.has(measure) for arm in (*its, *others)):
                x, y = (
                    [_scores(arm.each, measure, arm.most) for arm in side] for side in (its, others)
                )
                probability[measure.name] = st.improvement(x, y, chance)
        env_ids = [arm.env_id for arm in its]
        across.append(Across(name, env_ids, st.over_tasks(shares, chance), probability))
    return across


def _changed(study: Study) -> list[str]:
    """Say where arms were trained in environments that mean something else today: one each."""
    found = []
    for arm in arms(study):
        begun = [c.config.folder for c in arm.cells if c.config.folder.is_dir()]
        warning = changed_meaning(begun[0]) if begun else None
        found += [warning] if warning is not None else []
    return found
