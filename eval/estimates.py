"""Numbers with intervals over runs: of scores, learning curves, times to a threshold, pairs."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from eval import statistics as st
from eval.results import Band, Crossing, Estimate


class Chance(NamedTuple):
    """How intervals are drawn."""

    rng: np.random.Generator
    samples: int
    """Of the bootstrap."""
    confidence: float

    def interval(self, draws: np.ndarray) -> tuple[float, float]:
        """Return the central interval of draws (samples,)."""
        low, high = st.percentile_interval(draws, self.confidence)
        return float(low), float(high)


def estimate(values: np.ndarray, chance: Chance) -> Estimate:
    """Interquartile mean over runs, with a bootstrap interval from two runs on.

    Args:
        values: (R,) one number per run.
        chance: how the interval is drawn.
    """
    value = float(st.interquartile_mean(values))
    if len(values) < 2:
        return Estimate(value)
    return Estimate(value, *chance.interval(_draws(values, chance)))


def band(x: Sequence[np.ndarray], y: Sequence[np.ndarray], chance: Chance) -> Band:
    """Interquartile mean of learning curves, with its interval, on the range that all cover.

    Args:
        x: abscissae of each run.
        y: what is learnt, likewise.
        chance: how the interval is drawn.
    """
    grid = st.common_grid(x)
    curves = st.interpolate(x, y, grid)
    value = st.interquartile_mean(curves)
    if len(curves) < 2:
        return Band(grid.tolist(), value.tolist(), None, None)
    draws = st.bootstrap(curves[:, None], chance.rng, samples=chance.samples)
    low, high = st.percentile_interval(draws, chance.confidence)
    return Band(grid.tolist(), value.tolist(), low.tolist(), high.tolist())


def crossing(each: np.ndarray, chance: Chance) -> Crossing:
    """Median of when the runs reached something, with its interval.

    Args:
        each: (R,) per run; infinity: not within its budget.
        chance: how the interval is drawn.
    """
    value = float(np.median(each))
    if len(each) < 2:
        return Crossing(each.tolist(), Estimate(value))
    draws = st.bootstrap(each[:, None], chance.rng, statistic=np.median, samples=chance.samples)
    return Crossing(each.tolist(), Estimate(value, *chance.interval(draws)))


def difference(x: np.ndarray, y: np.ndarray, chance: Chance) -> Estimate:
    """Difference of the interquartile means of x (R,) and y (R',)."""
    value = float(st.interquartile_mean(x) - st.interquartile_mean(y))
    if min(len(x), len(y)) < 2:
        return Estimate(value)
    return Estimate(value, *chance.interval(_draws(x, chance) - _draws(y, chance)))


def improvement(x: Sequence[np.ndarray], y: Sequence[np.ndarray], chance: Chance) -> Estimate:
    """Probability that a run of x beats one of y, the mean over tasks, with a stratified interval.

    Args:
        x: (R,) for each task; more is better.
        y: (R',), likewise.
        chance: how the interval is drawn.
    """
    tasks = [(a[:, None], b[:, None]) for a, b in zip(x, y, strict=True)]
    value = float(np.mean([st.probability_of_improvement(a, b) for a, b in tasks]))
    if min(len(side) for pair in tasks for side in pair) < 2:
        return Estimate(value)
    draws = [st.improvement_draws(a, b, chance.rng, chance.samples) for a, b in tasks]
    return Estimate(value, *chance.interval(np.mean(draws, axis=0)))


def over_tasks(values: Sequence[np.ndarray], chance: Chance) -> Estimate:
    """Mean over tasks of the interquartile mean over runs (R,), with a stratified interval.

    Every task counts the same, whatever the number of its runs.
    """
    value = float(np.mean([st.interquartile_mean(each) for each in values]))
    if min(map(len, values)) < 2:
        return Estimate(value)
    return Estimate(value, *chance.interval(np.mean([_draws(x, chance) for x in values], axis=0)))


def _draws(values: np.ndarray, chance: Chance) -> np.ndarray:
    return st.bootstrap(values[:, None], chance.rng, samples=chance.samples)
