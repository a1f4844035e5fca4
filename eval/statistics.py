"""Statistics over a few seeds: point estimates, bootstrap intervals, and what they cannot say.

The unit of chance is the run: one number for each, or one array such as a learning curve. The
estimators are those of Agarwal et al. 2021, "Deep reinforcement learning at the edge of the
statistical precipice"; resampling and tests are scipy's.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from eval.results import Band, Crossing, Estimate

Values = Sequence[float] | np.ndarray
Statistic = Callable[..., np.ndarray]
"""Maps one array or several, and the axis of the runs, to values with that axis removed."""

SPLITS = 20_000  # up to so many ways to split the runs in two, the permutation test is exact

_AT_ONCE = 1000  # of them, so that hundreds of robots fit in memory


class Chance(NamedTuple):
    """Confidence level, draws and seed of intervals."""

    rng: np.random.Generator
    samples: int  # of the bootstrap
    confidence: float

    def interval(self, data: Sequence[np.ndarray], statistic: Statistic) -> np.ndarray:
        """Return the percentile interval of a statistic by a stratified bootstrap.

        The runs of each group are drawn with replacement among themselves, so every resampled set
        holds as many of each group as the original. The bounds are draws themselves, rounded
        outwards: nothing is interpolated, so infinite values (a threshold that was never reached)
        are allowed and the interval is never too narrow.

        Each group (R, ...) has at least two runs; the bounds are (2, ...), lower and upper.
        """
        with np.errstate(invalid="ignore"):  # of scipy's own interval, where values are infinite
            drawn = stats.bootstrap(
                data, statistic, n_resamples=self.samples, axis=0, vectorized=True,
                method="percentile", rng=self.rng,
            ).bootstrap_distribution  # fmt: skip
        tail = (1.0 - self.confidence) / 2.0
        low = np.quantile(drawn, tail, axis=-1, method="lower")
        return np.array([low, np.quantile(drawn, 1.0 - tail, axis=-1, method="higher")])

    def estimate(self, data: Sequence[np.ndarray], statistic: Statistic) -> Estimate:
        """Return a statistic of groups (R,), with its interval where each has two runs or more.

        What was not measured, NaN, has none.
        """
        value = float(statistic(*data, axis=0))
        if min(map(len, data)) < 2 or math.isnan(value):
            return Estimate(value)
        return Estimate(value, *map(float, self.interval(data, statistic)))


def interquartile_mean(values: np.ndarray, axis: int = 0) -> np.ndarray:
    """Mean of the middle half: a quarter of the values, rounded down, is cut off at either end.

    Less swayed by one outlying seed than the mean, and less wasteful than the median. Of fewer than
    four values it is the mean.
    """
    return stats.trim_mean(values, 0.25, axis=axis)


def estimate(values: np.ndarray, chance: Chance) -> Estimate:
    """Interquartile mean over runs (R,)."""
    return chance.estimate([values], interquartile_mean)


def band(x: Sequence[Values], y: Sequence[Values], chance: Chance) -> Band:
    """Interquartile mean of learning curves, with its interval, on the range that all cover.

    Of each run, x are the increasing abscissae, y what is learnt.
    """
    grid = common_grid(x)
    curves = np.stack([np.interp(grid, xs, ys) for xs, ys in zip(x, y, strict=True)])
    low, high = None, None
    if len(curves) > 1:
        low, high = chance.interval([curves], interquartile_mean).tolist()
    return Band(grid.tolist(), interquartile_mean(curves).tolist(), low, high)


def common_grid(x: Sequence[Values], points: int = 200) -> np.ndarray:
    """Return points evenly spaced over what all curves cover, or the one point that they share."""
    start, stop = max(values[0] for values in x), min(values[-1] for values in x)
    return np.linspace(start, stop, points) if stop > start else np.array([min(start, stop)])


def crossing(each: np.ndarray, chance: Chance) -> Crossing:
    """Median of when the runs (R,) reached something; infinity: not within its budget."""
    return Crossing(each.tolist(), chance.estimate([each], np.median))


def first_crossing(x: Values, y: Values, threshold: float) -> float:
    """Find where a curve (K,) first reaches a threshold, by linear interpolation.

    A point that does not count is minus infinity, and then the next one that reaches the threshold
    is the time: what is not known in between is not guessed. It is x[0] if the curve starts at or
    above the threshold (reached there or before); infinity if it never reaches it. A censored run
    is thereby later than any budget, never left out.
    """
    above = np.flatnonzero(np.asarray(y) >= threshold)
    if above.size == 0:
        return math.inf
    k = int(above[0])
    if k == 0 or not math.isfinite(y[k - 1]):
        return float(x[k])
    share = (threshold - y[k - 1]) / (y[k] - y[k - 1])
    return float(x[k - 1] + share * (x[k] - x[k - 1]))


def difference(x: np.ndarray, y: np.ndarray, chance: Chance) -> Estimate:
    """Difference of the interquartile means of x (R,) and y (R',)."""

    def apart(x: np.ndarray, y: np.ndarray, axis: int) -> np.ndarray:
        return interquartile_mean(x, axis) - interquartile_mean(y, axis)

    return chance.estimate([x, y], apart)


def difference_over_episodes(x: np.ndarray, y: np.ndarray, chance: Chance) -> Estimate:
    """Difference of the interquartile means over runs, each the mean of episodes all have played.

    Runs of x (R, E) and of y (R', E), and the episodes that they share, are drawn with replacement,
    so that the interval holds for other runs and other episodes. Two runs at least; or it has none.
    """
    rng, sides = chance.rng, (x, y)
    value = float(np.subtract(*(interquartile_mean(side.mean(axis=1)) for side in sides)))
    if min(map(len, sides)) < 2:
        return Estimate(value)
    drawn = np.empty(chance.samples)
    for k in range(chance.samples):
        shares = rng.multinomial(x.shape[1], np.full(x.shape[1], 1.0 / x.shape[1])) / x.shape[1]
        means = [side[rng.integers(len(side), size=len(side))] @ shares for side in sides]
        drawn[k] = np.subtract(*map(interquartile_mean, means))
    tail = (1.0 - chance.confidence) / 2.0
    return Estimate(value, *map(float, np.quantile(drawn, [tail, 1.0 - tail])))


def over_tasks(values: Sequence[np.ndarray], chance: Chance) -> Estimate:
    """Mean over tasks of the interquartile mean over runs (R,): every task counts the same."""

    def mean(*tasks: np.ndarray, axis: int) -> np.ndarray:
        return np.mean([interquartile_mean(each, axis) for each in tasks], axis=0)

    return chance.estimate(values, mean)


def improvement(x: Sequence[np.ndarray], y: Sequence[np.ndarray], chance: Chance) -> Estimate:
    """Probability that a run of x beats one of y on the same task, the mean over tasks.

    The Mann-Whitney statistic of each task over the number of pairs; ties count one half. When
    every run of one side beats every run of the other, each resampled set says the same and the
    interval has no width. That is a limit of the bootstrap, not certainty: see `p_value`. More is
    better; x has (R,) for each task, y (R',).
    """

    def beats(*sides: np.ndarray, axis: int) -> np.ndarray:
        tasks = zip(sides[::2], sides[1::2], strict=True)
        return np.mean([_beats(a, b, axis) for a, b in tasks], axis=0)

    return chance.estimate([side for pair in zip(x, y, strict=True) for side in pair], beats)


def _beats(x: np.ndarray, y: np.ndarray, axis: int) -> np.ndarray:
    """P(X > Y): the share of the pairs that x wins, ties counting one half, from x's ranks."""
    size, others = x.shape[axis], y.shape[axis]
    ranks = stats.rankdata(np.concatenate([x, y], axis), axis=axis).take(range(size), axis)
    return (ranks.sum(axis) - 0.5 * size * (size + 1)) / (size * others)


def p_value(x: np.ndarray, y: np.ndarray, rng: np.random.Generator) -> float:
    """Chance of P(X > Y) at least this far from one half if the labels X and Y meant nothing.

    The two-sided Mann-Whitney permutation test of x (R,) and y (R'). Its smallest possible value
    with n runs on each side, all of x above all of y, is 2 / C(2n, n): 1/3 for two, 1/10 for three,
    1/35 for four.
    """
    if min(len(x), len(y)) < 2:  # of which scipy permutes nothing
        return float(stats.mannwhitneyu(x, y, method="exact").pvalue)

    def distance(x: np.ndarray, y: np.ndarray, axis: int) -> np.ndarray:
        return np.abs(_beats(x, y, axis) - 0.5)

    test = stats.permutation_test(
        (x, y), distance, vectorized=True, n_resamples=SPLITS, batch=_AT_ONCE,
        alternative="greater", rng=rng,
    )  # fmt: skip
    return float(test.pvalue)


def signed_rank(apart: np.ndarray) -> float:
    """Wilcoxon's signed-rank test that differences (R,) lie about zero: p, 1 if all are zero."""
    return float(stats.wilcoxon(apart).pvalue) if apart.any() else 1.0


def paired(x: np.ndarray, y: np.ndarray, confidence: float) -> tuple[Estimate, float]:
    """Set runs against a policy that is no run, on the same episodes.

    What is found shall hold for other runs and for other episodes, so the variance of the mean
    difference is that of the means of the runs plus that of the means of the episodes, with degrees
    of freedom after Welch and Satterthwaite: the min F' of Clark 1973, "The
    language-as-fixed-effect fallacy". Of two policies that are no runs it is the paired t-test over
    episodes.

    x and y are (R, E) of runs and episodes, or (E,) of a policy that is no run; one at least is
    (E,).

    Returns:
        The mean of x - y with its interval, and the two-sided p-value: no interval, and 1, where
        there is one run or one episode only.
    """
    apart = np.atleast_2d(x - y)
    value = float(apart.mean())
    units = [apart.mean(axis=axis) for axis in range(max(x.ndim, y.ndim))]
    if min(map(len, units)) < 2:
        return Estimate(value), 1.0
    variances = np.array([means.var(ddof=1) / len(means) for means in units])
    error = math.sqrt(variances.sum())
    if error <= 1e-12 * abs(value) or error == 0.0:
        return Estimate(value, value, value), float(value == 0.0)
    freedom = np.array([len(means) - 1 for means in units])
    t = stats.t(variances.sum() ** 2 / (variances**2 / freedom).sum())
    half = float(t.ppf((1.0 + confidence) / 2.0)) * error
    return Estimate(value, value - half, value + half), float(2.0 * t.sf(abs(value) / error))


def holm(p_values: Sequence[float]) -> list[float]:
    """Correct p-values for their number: Holm 1979, "A simple sequentially rejective procedure".

    Each is at most as small as the chance that any of them is, were there no effect at all.
    """
    order = np.argsort(p_values)
    factors = np.arange(len(p_values), 0, -1)
    corrected = np.empty(len(p_values))
    ranked = np.minimum(np.array(p_values, float)[order] * factors, 1.0)
    corrected[order] = np.maximum.accumulate(ranked)
    return corrected.tolist()


def coverage_ceiling(seeds: int) -> float:
    """Largest possible chance that a percentile bootstrap interval holds the true median.

    Such an interval never reaches beyond the worst and the best seed, and all `seeds` values lie on
    one side of the median with probability 2 (1/2)^seeds: 50 % for two seeds, 94 % for five.
    """
    return 1.0 - 2.0 ** (1 - seeds)
