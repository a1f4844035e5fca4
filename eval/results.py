"""What a comparison of action layers finds, as data: `report` turns it into words and pictures.

The unit of chance is the run: a seed, trained and then played for many episodes, is one number. The
episodes of one run say how well that run is known, not how well the layer is, so they are averaged
first and the intervals are over runs only.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.options import Each, Number, Whole
from fbid_gym.runtime.config import EnvConfig


@dataclass(frozen=True)
class Settings:
    """How runs are compared."""

    episodes: Annotated[int, Whole(1, 1_000_000)] = 50
    """Deterministic episodes per run, and for the zero action of each layer."""
    seed: Annotated[int, Whole(0, 2**63)] = 20_000
    """Of the episodes: the same for every run, and none that training evaluates on."""
    threshold: Annotated[float, Number(-1e9, 1e9)] | None = None
    """Return whose first crossing is timed. None: `threshold_share` of the way from the lowest
    first to the highest last evaluation of any layer."""
    threshold_share: Annotated[float, Number(0.0, 1.0)] = 0.9
    """See `threshold`."""
    sweep: Annotated[tuple[float, ...], Each(Number(0.001, 1000.0))] = (0.5, 0.75, 1.0, 1.25)
    """Sizes of push at which survival is measured, relative to the hardest of training."""
    sweep_episodes: Annotated[int, Whole(1, 1_000_000)] = 16
    """Episodes per run and size of push."""
    sweep_seconds: Annotated[float, Number(0.1, 10_000.0, "s")] = 5.0
    """Length of these episodes, s."""
    video_seconds: Annotated[float, Number(0.0, 600.0, "s")] = 6.0
    """Length of the clips, s. 0: none."""
    video_push: Annotated[float, Number(0.0, 1000.0)] = 0.75
    """Size of the pushes in the clips, relative to the hardest of training."""
    confidence: Annotated[float, Number(0.01, 0.9999)] = 0.95
    """Of the intervals."""
    samples: Annotated[int, Whole(1, 1_000_000)] = 5000
    """Bootstrap samples."""


def greatest_return(env_id: str, arguments: Mapping[str, Any]) -> float:
    """Return that no episode exceeds: in environments of ours a policy step earns at most 1.

    NaN for an environment of somebody else.
    """
    if env_id not in ENVIRONMENTS:
        return math.nan
    its = EnvConfig.of({**ENVIRONMENTS[env_id], **arguments})
    return its.policy_hz * its.episode_seconds


@dataclass(frozen=True)
class Estimate:
    """A number and its interval over seeds; without bounds where one seed leaves none."""

    value: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Band:
    """A learning curve over seeds on a common grid."""

    grid: list[float]
    value: list[float]
    low: list[float] | None
    high: list[float] | None


@dataclass(frozen=True)
class Crossing:
    """When the runs of a layer first reached the threshold."""

    each: list[float]  # per run; infinity: not within its budget
    median: Estimate  # over all runs, with the ones that did not get there later than all that did

    @property
    def reached(self) -> int:
        """How many runs got there."""
        return sum(math.isfinite(value) for value in self.each)


@dataclass(frozen=True)
class RunResult:
    """One run."""

    name: str
    path: str
    seed: int | None
    trained_steps: int
    wall_seconds: float | None
    metrics: dict[str, float]  # mean over episodes, by the names of `METRICS`
    steps: list[float]  # abscissae of the learning curve, empty for an exported policy
    wall: list[float]
    returns: list[float]
    sweep: list[float]  # share of episodes survived at each size of push
    command: str = ""  # the command line that trains it again; empty for an exported policy


@dataclass(frozen=True)
class Layer:
    """One action layer: its runs and what they say together."""

    name: str
    env_args: dict[str, Any]
    runs: list[RunResult]
    metrics: dict[str, Estimate]
    zero_action: dict[str, float]
    by_steps: Band | None
    by_wall: Band | None
    steps_to: Crossing | None
    wall_to: Crossing | None
    sweep: list[Estimate]  # share of episodes survived at each size of push in `Comparison.sweep`
    zero_sweep: list[float]  # the same for the zero action

    @property
    def seeds(self) -> int:
        """Number of runs."""
        return len(self.runs)

    def values(self, metric: str) -> np.ndarray:
        """Return (R,) one number per run."""
        return np.array([run.metrics[metric] for run in self.runs])


@dataclass(frozen=True)
class Pair:
    """Two layers, final return."""

    better: str  # the one with the higher estimate
    other: str
    probability: Estimate  # that a run of the better one beats a run of the other
    difference: Estimate  # of the interquartile means
    p_value: float  # of the two-sided Mann-Whitney permutation test


@dataclass(frozen=True)
class Comparison:
    """Everything in the report but the clips."""

    env_id: str
    env_args: dict[str, Any]
    settings: Settings
    layers: list[Layer]  # best final return first
    pairs: list[Pair]
    threshold: float | None  # return whose first crossing is timed; None without learning curves
    hardest_push: float  # largest push met in the episodes, N, rounded up to two digits
    sweep: list[float]  # sizes of push at which survival was measured, N
    warnings: list[str]
    shared: dict[str, Any]  # training settings all runs have in common
    versions: dict[str, Any]

    @property
    def budget(self) -> int:
        """Training steps of the longest run."""
        return max(run.trained_steps for layer in self.layers for run in layer.runs)
