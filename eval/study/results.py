"""Results of a study's runs, as data: `page` turns them into words and pictures."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from eval.results import Band, Crossing, Estimate
from eval.statistics import Chance
from eval.study.fresh import OF_EPISODES, Falls
from eval.wording import METRIC
from fbid_gym.options import Each, Number, Whole
from train.episodes import Metric


@dataclass(frozen=True)
class Settings:
    """Settings of the statistics of a study."""

    thresholds: Annotated[tuple[float, ...], Each(Number(1e-6, 1e6, "m/s"))] = (
        *(0.3, 0.2, 0.15, 0.1, 0.07),
    )
    """Velocity errors, m/s, whose first reaching is timed."""
    survival: Annotated[float, Number(0.0, 1.0)] = 0.8
    """Share of the episodes that must not end in a fall for a velocity error to count as reached:
    who falls at once has hardly erred."""
    seed: Annotated[int, Whole(0, 2**63)] = 20_000
    """Of the bootstrap, and of what is played and not kept: robot i starts from seed + i."""
    samples: Annotated[int, Whole(1, 1_000_000)] = 5000
    """Of the bootstrap."""
    confidence: Annotated[float, Number(0.01, 0.9999)] = 0.95
    """Of the intervals."""

    def chance(self) -> Chance:
        """Return how intervals are drawn, from the beginning."""
        return Chance(np.random.default_rng(self.seed), self.samples, self.confidence)


class Measure(Metric):
    """A number of an evaluation, by its column or made of one."""

    def of(self, table: dict[str, np.ndarray]) -> np.ndarray:
        """Return it from the columns of evaluations, (K,); NaN where they do not have it."""
        falls = self.name == "falls"
        unknown = np.full(len(next(iter(table.values()))), np.nan)
        values = table.get("survival" if falls else self.name, unknown)
        return 1.0 - values if falls else values


RETURN = Measure("return_mean", "return", "", 1)
ERROR = Measure("velocity_error", "velocity error", "m/s", -1)
FALLS = Measure("falls", "falls", "share", -1)
MEASURES = (
    *(RETURN, ERROR, Measure("turning_error", "yaw rate error", "rad/s", -1)),
    *(Measure("slip", "foot slip", "m/s", -1), FALLS),
    Measure("cost_of_transport", "cost of transport", "", -1),
    # Of episodes alone: evaluations in training have no such columns.
    *(Measure(*vars(METRIC[name]).values()) for name in OF_EPISODES),
)
CURVES = (RETURN, ERROR)  # what is drawn over steps and time
JUDGED = (RETURN, ERROR, FALLS)  # in what an arm is set against the reference


Values = Mapping[str, list[float]]  # by measure, of each run


@dataclass(frozen=True)
class CellFound:
    """One training."""

    name: str
    seed: int | None  # None of an exported policy, which does not know it
    state: str  # see `train.runs.training.Status`
    note: str
    steps: list[float]  # of its evaluations
    wall: list[float]  # likewise, s
    fallen: list[float]  # likewise: falls in training by then; NaN where they were not counted
    curves: dict[str, list[float]]  # by measure
    command: str  # that trains it

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

    probability: Estimate  # that a run of the arm does better than one of the reference
    p_value: float
    """Of the two-sided Mann-Whitney permutation test; where one of the two learns nothing, of
    `statistics.paired`."""


@dataclass(frozen=True)
class Fresh:
    """Results of an arm's policies in fresh episodes, see `eval.study.fresh`."""

    runs: list[str]  # names of the cells that played, as many episodes each
    falls: Falls
    each: dict[str, list[float]]  # by measure, of each run
    final: dict[str, Estimate]  # by measure
    versus: dict[str, Versus] = field(default_factory=dict)
    """By measure; empty for the reference and where either has none."""


@dataclass(frozen=True)
class Level:
    """The best policy without learning of an environment: that with the highest return."""

    name: str  # of its arm
    share: float
    """Its return over the most that can be earned, where that is known, in the episodes that
    trainings are evaluated in."""


@dataclass(frozen=True)
class ArmFound:
    """An arm in an environment: its cells and what they say together.

    One that learns nothing has no cells. What counts is its evaluation in the episodes that
    trainings are evaluated in; the interval is over them, and each measure is one number. What has
    a default here is found by `eval.study.findings.together`.
    """

    env_id: str
    name: str
    layer: str  # action layer with its options, in words
    most: float  # return that no episode exceeds; NaN where that is not known
    cells: list[CellFound]
    counted: list[str] = field(default_factory=list)
    """Names of the cells that the numbers are of: those done, or those begun where none is; of what
    learns nothing, what it is called in what was played."""
    policy: str = ""  # what acts where nothing is learnt
    steps: float = 0.0  # after which the numbers are; 0 without any
    before: dict[str, float] = field(default_factory=dict)
    """By measure: of the zero action, the mean of the first evaluations."""
    each: dict[str, list[float]] = field(default_factory=dict)  # by measure, of each counted cell
    final: dict[str, Estimate] = field(default_factory=dict)  # by measure
    by_steps: dict[str, Band] = field(default_factory=dict)
    by_wall: dict[str, Band] = field(default_factory=dict)
    steps_to: list[Crossing] = field(default_factory=list)
    """For each threshold; empty where no velocity is commanded."""
    wall_to: list[Crossing] = field(default_factory=list)
    falls_to: list[Crossing] = field(default_factory=list)
    """Falls in training before it; empty where they were not counted."""
    versus: dict[str, Versus] = field(default_factory=dict)
    """By measure; empty for the reference and where either has no cell that is done."""
    fresh: Fresh | None = None  # None where no cell that is done has played any
    level_to: dict[str, Crossing] = field(default_factory=dict)
    """"steps", "wall" and "fallen" -> when the return first reaches the `Level`; empty where there
    is none, and without falls where they were not counted."""

    @property
    def ready(self) -> bool:
        """Whether its numbers are those of an end."""
        return bool(self.done or (self.policy and self.final))

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
    share: Estimate  # return over the most that can be earned: the mean of the interquartile means
    probability: dict[str, Estimate]
    """By measure: of doing better than the reference; empty for the reference."""


@dataclass(frozen=True)
class Answer:
    """Answer to an endpoint."""

    env_id: str
    arm: str
    against: str
    measure: Measure
    fresh: bool  # whether it is of fresh episodes; else of the last evaluations
    means: tuple[float, float]  # over the runs of the arm, and of that which it is set against
    paired: bool  # whether one of the two learns nothing, so that they are paired by episodes
    difference: Estimate
    """Of the interquartile means, the arm's less the other's; where paired of the means."""
    p_value: float  # of the two-sided Mann-Whitney permutation test, or of `statistics.paired`
    corrected: float  # the same, corrected for the number of endpoints by Holm's method


@dataclass(frozen=True)
class Findings:
    """All that the page says but clips and robustness."""

    name: str
    title: str
    reference: str
    settings: Settings
    arms: list[ArmFound]
    warnings: list[str]
    versions: dict[str, Any]  # of the first run that there is
    across: list[Across] = field(default_factory=list)
    answers: list[Answer] = field(default_factory=list)
    """To the endpoints, once both arms have trainings that are done; if one of them learns nothing,
    once both have played fresh episodes."""
    levels: dict[str, Level] = field(default_factory=dict)  # by environment

    def environments(self) -> dict[str, list[ArmFound]]:
        """Return the arms by environment."""
        found: dict[str, list[ArmFound]] = {}
        for arm in self.arms:
            found.setdefault(arm.env_id, []).append(arm)
        return found
