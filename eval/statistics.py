"""Statistics over a few seeds: point estimates, bootstrap intervals, and what they cannot say.

Scores are arrays (R, T, ...): R runs (seeds) of each of T tasks, and any further axes such as time,
for which every statistic is taken separately. The estimators are those of Agarwal et al. 2021,
"Deep reinforcement learning at the edge of the statistical precipice". Every random draw comes from
the generator that is passed in.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from statistics import NormalDist

import numpy as np

Statistic = Callable[..., np.ndarray]
"""Maps (values, axis=...) to values with that axis removed, as np.mean does."""

Interval = tuple[np.ndarray, np.ndarray]
"""Lower and upper bound, each shaped like the estimate."""


def interquartile_mean(values: np.ndarray, axis: int = 0) -> np.ndarray:
    """Mean of the middle half: a quarter of the values is cut off at either end.

    Less swayed by one outlying seed than the mean, and less wasteful than the median. The number
    cut off is rounded down, so with fewer than four values it is the plain mean.

    Args:
        values: any shape.
        axis: the axis to reduce.
    """
    ordered = np.sort(np.asarray(values, dtype=float), axis=axis)
    count = ordered.shape[axis]
    cut = count // 4
    return np.take(ordered, range(cut, count - cut), axis=axis).mean(axis=axis)


def bootstrap(
    scores: np.ndarray,
    rng: np.random.Generator,
    statistic: Statistic = interquartile_mean,
    samples: int = 2000,
) -> np.ndarray:
    """Stratified bootstrap: the statistic of `samples` resampled sets of runs.

    Each task is a stratum: its R runs are drawn with replacement among themselves, so every
    resampled set holds as many runs of each task as the original.

    Args:
        scores: (R, T, ...).
        rng: source of the draws.
        statistic: taken over runs and tasks together.
        samples: number of resampled sets.

    Returns:
        (samples, ...).
    """
    runs, tasks = scores.shape[:2]
    rows = rng.integers(runs, size=(samples, runs, tasks))
    drawn = scores[rows, np.arange(tasks)]
    return statistic(drawn.reshape(samples, runs * tasks, *scores.shape[2:]), axis=1)


def percentile_interval(draws: np.ndarray, confidence: float = 0.95) -> Interval:
    """Central interval of draws along the first axis.

    The bounds are draws themselves, rounded outwards: nothing is interpolated, so infinite draws
    (a threshold that was never reached) are allowed and the interval is never too narrow.
    """
    tail = (1.0 - confidence) / 2.0
    return (
        np.quantile(draws, tail, axis=0, method="lower"),
        np.quantile(draws, 1.0 - tail, axis=0, method="higher"),
    )


def wilson_interval(share: float, count: int, confidence: float = 0.95) -> tuple[float, float]:
    """Interval of a share of `count` independent cases, by Wilson's score.

    Unlike those of a bootstrap it has a width where all cases agree.
    """
    z = NormalDist().inv_cdf(0.5 + confidence / 2.0)
    centre = share + z**2 / (2 * count)
    reach = z * math.sqrt(share * (1.0 - share) / count + z**2 / (4 * count**2))
    low, high = ((centre + sign * reach) / (1.0 + z**2 / count) for sign in (-1.0, 1.0))
    return max(low, 0.0), min(high, 1.0)


def probability_of_improvement(x: np.ndarray, y: np.ndarray) -> float:
    """P(X > Y): how often a run of X beats a run of Y on the same task; ties count one half.

    The Mann-Whitney statistic of each task divided by the number of pairs, averaged over tasks.

    Args:
        x: (R_x, T).
        y: (R_y, T).
    """
    difference = x[:, None] - y[None, :]
    return float(np.mean((difference > 0) + 0.5 * (difference == 0)))


def improvement_draws(
    x: np.ndarray, y: np.ndarray, rng: np.random.Generator, samples: int = 2000
) -> np.ndarray:
    """Stratified bootstrap of `probability_of_improvement`: (samples,).

    When every run of one side beats every run of the other, each resampled set says the same and
    an interval of these has no width. That is a limit of the bootstrap, not certainty: see
    `permutation_p_value`.
    """
    tasks = np.arange(x.shape[1])
    x_drawn = x[rng.integers(len(x), size=(samples, *x.shape)), tasks]
    y_drawn = y[rng.integers(len(y), size=(samples, *y.shape)), tasks]
    difference = x_drawn[:, :, None] - y_drawn[:, None, :]
    return np.mean((difference > 0) + 0.5 * (difference == 0), axis=(1, 2, 3))


def permutation_p_value(
    x: np.ndarray, y: np.ndarray, rng: np.random.Generator, limit: int = 20_000
) -> float:
    """Chance of P(X > Y) at least this far from one half if the labels X and Y meant nothing.

    The two-sided Mann-Whitney test, exact (every way to split the pooled runs in two) up to `limit`
    splits, otherwise `limit` random splits together with the observed one. Its smallest possible
    value with n runs on each side, all of X above all of Y, is 2 / C(2n, n): 1/3 for two, 1/10 for
    three, 1/35 for four.

    Args:
        x: (R_x,).
        y: (R_y,).
        rng: used only above the limit.
        limit: largest number of splits.
    """
    pooled = np.concatenate([x, y])
    total, size = len(pooled), len(x)
    if math.comb(total, size) <= limit:
        chosen = np.array(list(itertools.combinations(range(total), size)))
    else:
        shuffled = rng.permuted(np.tile(np.arange(total), (limit, 1)), axis=1)
        chosen = np.concatenate([np.arange(size)[None], shuffled[:, :size]])
    above = pooled[:, None] > pooled
    rank = np.sum(above + 0.5 * (pooled[:, None] == pooled), axis=1)
    distance = np.abs(rank[chosen].sum(axis=1) - size * total / 2)
    return float(np.mean(distance >= distance[0] - 1e-9))  # the first split is the observed one


def coverage_ceiling(seeds: int) -> float:
    """Largest possible chance that a percentile bootstrap interval holds the true median.

    Such an interval never reaches beyond the worst and the best seed, and all `seeds` values lie on
    one side of the median with probability 2 (1/2)^seeds: 50 % for two seeds, 94 % for five.
    """
    return 1.0 - 2.0 ** (1 - seeds)


def common_grid(x: Sequence[np.ndarray], points: int = 200) -> np.ndarray:
    """Evenly spaced grid over the range that every curve covers.

    Args:
        x: increasing abscissae, one array per curve.
        points: grid size.

    Returns:
        (points,), or one point where the curves share only that.
    """
    start, stop = max(values[0] for values in x), min(values[-1] for values in x)
    return np.linspace(start, stop, points) if stop > start else np.array([min(start, stop)])


def interpolate(x: Sequence[np.ndarray], y: Sequence[np.ndarray], grid: np.ndarray) -> np.ndarray:
    """Curves y(x) on a common grid, linearly interpolated.

    Returns:
        (curves, grid size).
    """
    return np.stack([np.interp(grid, xs, ys) for xs, ys in zip(x, y, strict=True)])


def first_crossing(x: np.ndarray, y: np.ndarray, threshold: float) -> float:
    """Where a curve first reaches a threshold, linearly interpolated between its points.

    Args:
        x: (K,) increasing abscissae.
        y: (K,); minus infinity where a point does not count, and then the next one that reaches
            the threshold is the time: what is not known in between is not guessed.
        threshold: to be reached.

    Returns:
        The abscissa; x[0] if the curve starts at or above the threshold (reached there or before);
        infinity if it never reaches it. A censored run is thereby later than any budget, never
        left out.
    """
    above = np.flatnonzero(y >= threshold)
    if above.size == 0:
        return math.inf
    k = int(above[0])
    if k == 0:
        return float(x[0])
    if not math.isfinite(y[k - 1]):
        return float(x[k])
    share = (threshold - y[k - 1]) / (y[k] - y[k - 1])
    return float(x[k - 1] + share * (x[k] - x[k - 1]))
