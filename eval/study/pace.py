"""Policies that decide at different rates, side by side: over the same time, of the same most."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from eval.page.figures import Series
from eval.study.results import RETURN
from eval.wording import number


class Pace(NamedTuple):
    """Common axis of the arms of one environment."""

    share: Mapping[str, float]
    """By arm, what its steps and its returns are multiplied by: 1 for the slowest."""
    most: float  # return that an episode of the slowest cannot exceed

    @classmethod
    def of(cls, most: Iterable[tuple[str, float]]) -> "Pace":
        """Derive it from arms with what an episode of each can earn at most, NaN where unknown.

        A policy step earns at most 1, so that is also how many steps an episode has.
        """
        by_arm = dict(most)
        slowest = min(by_arm.values())
        known = bool(np.isfinite(list(by_arm.values())).all())
        share = {arm: slowest / its if known else 1.0 for arm, its in by_arm.items()}
        return cls(share, slowest)

    @property
    def differs(self) -> bool:
        """Whether one arm decides more often than another."""
        return any(share != 1.0 for share in self.share.values())

    def scaled(self, series: Series, measure: str, *, over_steps: bool = True) -> Series:
        """Return the series of an arm, of its name, as it is drawn with the others."""
        share = self.share[series.name]
        along = share if over_steps else 1.0
        up = share if measure == RETURN.name else 1.0
        return replace(
            series,
            x=along * np.asarray(series.x),
            value=up * np.asarray(series.value),
            low=None if series.low is None else up * np.asarray(series.low),
            high=None if series.high is None else up * np.asarray(series.high),
            singles=[(along * np.asarray(x), up * np.asarray(y)) for x, y in series.singles],
        )

    def titled(self, title: str, measure: str) -> str:
        """Say of a return of which most it is, where that is not the same for all."""
        scaled = self.differs and measure == RETURN.name
        return f"{title} of {number(self.most)}" if scaled else title

    @property
    def steps(self) -> str:
        """Label of the axis of steps."""
        return "steps of the slowest in that time" if self.differs else "training steps"
