"""What the run folders of a study say together, as data: `page` turns it into words and pictures.

The unit of chance is the run. Its numbers are those of its latest evaluation in training: the last
policy, on episodes that no choice was made by, the same for every run. The first evaluation is the
zero action, which is what a policy begins with.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from eval import estimates
from eval import statistics as st
from eval.comparable import origin_warnings
from eval.estimates import Chance
from eval.results import Band, Crossing, Estimate, greatest_return
from eval.study.cells import Arm, arms, check_cells, columns
from fbid_gym.errors import UnknownOptionError
from fbid_gym.options import Each, Number, Whole
from train.runs.command_line import command_again
from train.runs.differences import made_with
from train.runs.environment import changed_meaning
from train.runs.files import read_json
from train.runs.folder import RunFolder
from train.runs.reading import layer_name
from train.runs.study import Cell, Study
from train.runs.training import standing


@dataclass(frozen=True)
class Settings:
    """How the runs of a study are put together."""

    thresholds: Annotated[tuple[float, ...], Each(Number(1e-6, 1e6, "m/s"))] = (
        *(0.3, 0.2, 0.15, 0.1, 0.07),
    )
    """Velocity errors, m/s, whose first reaching is timed."""
    survival: Annotated[float, Number(0.0, 1.0)] = 0.8
    """Share of the episodes that must not end in a fall for a velocity error to count as reached:
    who falls at once has hardly erred."""
    seed: Annotated[int, Whole(0, 2**63)] = 20_000
    """Of the bootstrap, and of the clips."""
    samples: Annotated[int, Whole(1, 1_000_000)] = 5000
    """Of the bootstrap."""
    confidence: Annotated[float, Number(0.01, 0.9999)] = 0.95
    """Of the intervals."""


@dataclass(frozen=True)
class Measure:
    """A number of an evaluation."""

    name: str
    label: str
    unit: str
    better: int
    """1 if more is better, -1 if less is."""

    def of(self, table: dict[str, np.ndarray]) -> np.ndarray:
        """Return it from the columns of evaluations, (K,); NaN where they do not have it."""
        if self.name == "falls":
            return 1.0 - table.get("survival", np.full(len(table["steps"]), np.nan))
        return table.get(self.name, np.full(len(table["steps"]), np.nan))


RETURN = Measure("return_mean", "return", "", 1)
ERROR = Measure("velocity_error", "velocity error", "m/s", -1)
FALLS = Measure("falls", "falls", "share", -1)
MEASURES = (RETURN, ERROR, FALLS, Measure("cost_of_transport", "cost of transport", "", -1))
CURVES = (RETURN, ERROR)
"""What is drawn over steps and time."""
JUDGED = (RETURN, ERROR, FALLS)
"""In what an arm is set against the reference."""


@dataclass(frozen=True)
class CellFound:
    """One training."""

    name: str
    seed: int
    state: str
    """See `train.runs.training.Standing`."""
    note: str
    steps: list[float]
    """Of its evaluations."""
    wall: list[float]
    """Likewise, s."""
    curves: dict[str, list[float]]
    """By measure."""
    command: str
    """That trains it."""

    @property
    def begun(self) -> bool:
        """Whether it has been evaluated at all."""
        return bool(self.steps)

    def at(self, measure: str, steps: float) -> float:
        """Return a measure after so many steps."""
        return float(np.interp(steps, self.steps, self.curves[measure]))


@dataclass(frozen=True)
class Versus:
    """An arm against the reference, in one measure."""

    probability: Estimate
    """That a run of the arm does better than one of the reference."""
    p_value: float
    """Of the two-sided Mann-Whitney permutation test."""


@dataclass(frozen=True)
class ArmFound:
    """An arm in an environment: its cells and what they say together."""

    env_id: str
    name: str
    layer: str
    """Action layer with its options, in words."""
    most: float
    """Return that no episode exceeds; NaN where that is not known."""
    cells: list[CellFound]
    counted: list[str]
    """Names of the cells that the numbers are of: those done, or those begun where none is."""
    steps: float
    """After which the numbers are; 0 without any."""
    before: dict[str, float]
    """By measure: of the zero action, the mean of the first evaluations."""
    each: dict[str, list[float]]
    """By measure, of each counted cell."""
    final: dict[str, Estimate]
    """By measure."""
    by_steps: dict[str, Band]
    by_wall: dict[str, Band]
    steps_to: list[Crossing]
    """For each threshold; empty where no velocity is commanded."""
    wall_to: list[Crossing]
    versus: dict[str, Versus] = field(default_factory=dict)
    """By measure; empty for the reference and where either has no cell that is done."""

    @property
    def done(self) -> int:
        """Number of cells that have finished."""
        return sum(cell.state == "done" for cell in self.cells)

    @property
    def complete(self) -> bool:
        """Whether all have."""
        return self.done == len(self.cells)

    def has(self, measure: Measure) -> bool:
        """Whether it has been measured."""
        return measure.name in self.final and bool(np.isfinite(self.final[measure.name].value))


@dataclass(frozen=True)
class Across:
    """An arm over all environments that it and the reference were trained in."""

    name: str
    env_ids: list[str]
    share: Estimate
    """Return over the most that can be earned: the mean of the interquartile means."""
    probability: dict[str, Estimate]
    """By measure: of doing better than the reference; empty for the reference."""


@dataclass(frozen=True)
class Findings:
    """All that the page says but clips and robustness."""

    name: str
    title: str
    reference: str
    settings: Settings
    arms: list[ArmFound]
    across: list[Across]
    warnings: list[str]
    versions: dict[str, Any]
    """Of the first run that there is."""

    def environments(self) -> dict[str, list[ArmFound]]:
        """Return the arms by environment."""
        found: dict[str, list[ArmFound]] = {}
        for arm in self.arms:
            found.setdefault(arm.env_id, []).append(arm)
        return found


def findings(study: Study, settings: Settings, reference: str | None = None) -> Findings:
    """Read the run folders of a study and put them together.

    Args:
        study: what was to be trained.
        settings: how.
        reference: arm that the others are set against; None: the study's.

    Raises:
        RunError: a run folder of another training, or a file in one that cannot be read.
        UnknownOptionError: no arm has the name of the reference.
    """
    check_cells(study)
    reference = checked_reference(study, reference)
    rng = np.random.default_rng(settings.seed)
    chance = Chance(rng, settings.samples, settings.confidence)
    found = [_arm(arm, settings, chance) for arm in arms(study)]
    references = {arm.env_id: arm for arm in found if arm.name == reference}
    for arm in found:
        other = references.get(arm.env_id)
        if other is not None and other is not arm and arm.done and other.done:
            arm.versus.update(_versus(arm, other, chance))
    folders = [RunFolder.of(cell.config.folder) for cell in study.cells]
    versions = [read_json(folder.versions) for folder in folders if folder.versions.is_file()]
    return Findings(
        study.name,
        study.title,
        reference,
        settings,
        found,
        _across(found, references, chance),
        [*_changed(study), *origin_warnings([made_with(its) for its in versions])],
        versions[0] if versions else {},
    )


def checked_reference(study: Study, reference: str | None) -> str:
    """Return the arm that the others are set against; None: the study's.

    Raises:
        UnknownOptionError: no arm has that name.
    """
    names = dict.fromkeys(cell.arm for cell in study.cells)
    if reference is not None and reference not in names:
        raise UnknownOptionError("reference", reference, names)
    return study.reference if reference is None else reference


def _cell(cell: Cell) -> CellFound:
    table = columns(cell.config)
    where = standing(cell.config)
    return CellFound(
        cell.config.folder.name,
        cell.config.seed,
        where.state,
        where.note,
        table["steps"].tolist() if table else [],
        table.get("wall_seconds", table["steps"] * np.nan).tolist() if table else [],
        {measure.name: measure.of(table).tolist() for measure in MEASURES} if table else {},
        command_again(cell.config.to_json(), cell.config.folder),
    )


def _arm(arm: Arm, settings: Settings, chance: Chance) -> ArmFound:
    cells = [_cell(cell) for cell in arm.cells]
    begun = [cell for cell in cells if cell.begun]
    counted = [cell for cell in begun if cell.state == "done"] or begun
    until = min((cell.steps[-1] for cell in counted), default=0.0)
    each = {m.name: [cell.at(m.name, until) for cell in counted] for m in MEASURES if counted}
    known = [measure for measure in MEASURES if np.isfinite(each.get(measure.name, [np.nan])).all()]
    first = arm.cells[0].config
    timed = settings.thresholds if ERROR in known else ()
    return ArmFound(
        arm.env,
        arm.name,
        layer_name(first.make_args()),
        greatest_return(first.env, first.make_args()),
        cells,
        [cell.name for cell in counted],
        until,
        {m.name: float(np.mean([cell.curves[m.name][0] for cell in counted])) for m in known},
        each,
        {m.name: estimates.estimate(np.array(each[m.name]), chance) for m in known},
        {m.name: _band(counted, "steps", m, chance) for m in CURVES if m in known},
        {m.name: _band(counted, "wall", m, chance) for m in CURVES if m in known},
        [_crossing(counted, "steps", value, settings, chance) for value in timed],
        [_crossing(counted, "wall", value, settings, chance) for value in timed],
    )


def _band(cells: Sequence[CellFound], axis: str, measure: Measure, chance: Chance) -> Band:
    x = [np.array(getattr(cell, axis)) for cell in cells]
    return estimates.band(x, [np.array(cell.curves[measure.name]) for cell in cells], chance)


def _crossing(
    cells: Sequence[CellFound], axis: str, error: float, settings: Settings, chance: Chance
) -> Crossing:
    """When the runs first err no more than that, and stay up often enough.

    Interpolated between evaluations; from one at which too many fall it is not.
    """
    each = []
    for cell in cells:
        upright = 1.0 - np.array(cell.curves[FALLS.name]) >= settings.survival
        errors = np.where(upright, np.array(cell.curves[ERROR.name]), np.inf)
        each.append(st.first_crossing(np.array(getattr(cell, axis)), -errors, -error))
    return estimates.crossing(np.array(each), chance)


def _scores(arm: ArmFound, measure: Measure) -> np.ndarray:
    """What is compared, more being better; of returns the share of what can be earned.

    Arms that decide at different rates add up different numbers of rewards.
    """
    values = measure.better * np.array(arm.each[measure.name])
    return values / arm.most if measure is RETURN and np.isfinite(arm.most) else values


def _versus(arm: ArmFound, other: ArmFound, chance: Chance) -> dict[str, Versus]:
    found = {}
    for measure in (m for m in JUDGED if arm.has(m) and other.has(m)):
        x, y = _scores(arm, measure), _scores(other, measure)
        p_value = st.permutation_p_value(x, y, chance.rng)
        found[measure.name] = Versus(estimates.improvement([x], [y], chance), p_value)
    return found


def _across(
    found: Sequence[ArmFound], references: dict[str, ArmFound], chance: Chance
) -> list[Across]:
    """Return the arms that more than one environment has beside the reference."""
    by_name: dict[str, list[ArmFound]] = {}
    for arm in found:
        if arm.done and arm.env_id in references and references[arm.env_id].done:
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
                x, y = ([_scores(arm, measure) for arm in side] for side in (its, others))
                probability[measure.name] = estimates.improvement(x, y, chance)
        env_ids = [arm.env_id for arm in its]
        across.append(Across(name, env_ids, estimates.over_tasks(shares, chance), probability))
    return across


def _changed(study: Study) -> list[str]:
    """Say where arms were trained in environments that mean something else today: one each."""
    found = []
    for arm in arms(study):
        begun = [c.config.folder for c in arm.cells if c.config.folder.is_dir()]
        warning = changed_meaning(begun[0]) if begun else None
        found += [warning] if warning is not None else []
    return found
