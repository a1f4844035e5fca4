"""Results of runs together, as data.

The unit of chance is the run: a seed, trained and then played for many episodes, is one number. The
episodes of one run say how well that run is known, not how well the next would do, so they are
averaged first and the intervals are over runs only.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.runtime.config import EnvConfig


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
    """Steps at which the runs of an arm first reached the threshold."""

    each: list[float]  # per run; infinity: not within its budget
    median: Estimate  # over all runs, with the ones that did not get there later than all that did

    @property
    def reached(self) -> int:
        """Number of runs that got there."""
        return sum(math.isfinite(value) for value in self.each)
