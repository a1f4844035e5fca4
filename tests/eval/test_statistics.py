"""The laws that estimates and their intervals obey."""

import itertools
import math
import tracemalloc

import numpy as np
import pytest
from scipy import stats

from eval import statistics as st
from eval.results import Estimate


def chance(seed: int = 0, samples: int = 2000) -> st.Chance:
    return st.Chance(np.random.default_rng(seed), samples, 0.95)


def test_interquartile_mean_ignores_an_outlier_and_moves_with_its_data(rng):
    values = rng.normal(size=9)
    far = np.where(values == values.max(), 1e9, values)
    assert st.interquartile_mean(far) == st.interquartile_mean(values)
    moved = st.interquartile_mean(rng.permutation(3 * values + 7))
    assert moved == pytest.approx(3 * st.interquartile_mean(values) + 7)
    assert st.interquartile_mean(np.array([1.0, 2.0, 6.0])) == 3.0


def test_the_interval_of_two_runs_is_their_range_and_one_run_has_none():
    assert st.estimate(np.array([1.0, 3.0]), chance()) == Estimate(2.0, 1.0, 3.0)
    assert st.estimate(np.array([1.0]), chance()) == Estimate(1.0)
    unknown = st.estimate(np.array([np.nan, np.nan]), chance())
    assert math.isnan(unknown.value) and unknown.low is None


def test_intervals_are_those_of_all_resamplings_within_each_task(rng):
    tasks = [rng.normal(size=3), rng.normal(size=3) + 5.0]
    every = itertools.product(range(3), repeat=6)
    exact = [np.mean([tasks[k // 3][i] for k, i in enumerate(drawn)]) for drawn in every]
    found = st.over_tasks(tasks, chance(samples=40_000))
    expected = np.quantile(exact, (0.025, 0.975))
    np.testing.assert_allclose((found.low, found.high), expected, atol=0.03)


def test_a_threshold_that_is_not_always_reached_has_an_infinite_bound():
    found = st.crossing(np.array([10.0, 20.0, np.inf]), chance())
    assert found.median == Estimate(20.0, 10.0, np.inf) and found.reached == 2
    assert st.crossing(np.full(3, np.inf), chance()).median.low == np.inf


def test_the_two_probabilities_of_improvement_sum_to_one(rng):
    x, y = (list(rng.integers(0, 5, size=(3, runs)).astype(float)) for runs in (4, 7))
    one, other = st.improvement(x, y, chance()), st.improvement(y, x, chance())
    assert one.value + other.value == pytest.approx(1.0)
    assert 0 <= one.low <= one.value <= one.high <= 1
    assert st.improvement(x, x, chance()).value == 0.5
    apart = st.improvement([np.array([2.0, 3.0])], [np.array([0.0, 1.0])], chance())
    assert apart == Estimate(1.0, 1.0, 1.0)  # no width: a limit of the bootstrap


@pytest.mark.parametrize("seeds", [1, 2, 3, 5])
def test_separated_seeds_have_the_smallest_p_value_there_is(seeds, rng):
    x, y = np.arange(seeds) + 100.0, np.arange(seeds) * 1.0
    assert st.p_value(x, y, rng) == pytest.approx(2 / math.comb(2 * seeds, seeds))
    assert st.p_value(y, x, rng) == st.p_value(x, y, rng)
    assert st.p_value(x, x, rng) == 1.0


def test_hundreds_of_robots_are_told_apart_within_the_memory_there_is(rng):
    """As many as the benchmark of layers plays; the p-value is near the one without resampling."""
    x, y = rng.normal(size=320).round(1), rng.normal(size=320).round(1) + 0.2
    tracemalloc.start()
    found, (_, most) = st.p_value(x, y, rng), tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found == pytest.approx(stats.mannwhitneyu(x, y).pvalue, abs=0.005)
    assert most < 200e6
    wins = np.mean(x[:, None] > y) + 0.5 * np.mean(x[:, None] == y)
    assert st.improvement([x], [y], chance(samples=2)).value == pytest.approx(wins)


@pytest.mark.parametrize("seeds", [2, 3, 5])
def test_coverage_ceiling_is_how_often_the_seeds_surround_the_median(seeds, rng):
    values = rng.exponential(size=(100_000, seeds))
    surrounded = (values.min(axis=1) < np.log(2)) & (np.log(2) < values.max(axis=1))
    assert surrounded.mean() == pytest.approx(st.coverage_ceiling(seeds), abs=0.01)


def test_curves_meet_on_the_range_they_share():
    x = [np.array([0.0, 10.0, 20.0]), np.array([5.0, 15.0])]
    y = [np.array([0.0, 1.0, 0.0]), np.array([2.0, 4.0])]
    found = st.band(x, y, chance())
    for at, k, values in ((5.0, 0, (0.5, 2.0)), (15.0, -1, (0.5, 4.0))):
        assert found.grid[k] == at and found.value[k] == pytest.approx(np.mean(values))
        assert (found.low[k], found.high[k]) == pytest.approx(values)
    assert st.common_grid([np.array([3.0])]).tolist() == [3.0]


def test_first_crossing():
    x, y = np.array([0.0, 10.0, 20.0, 30.0]), np.array([0.0, 4.0, 2.0, 8.0])
    assert st.first_crossing(x, y, 2.0) == 5.0
    assert st.first_crossing(x, y, 5.0) == 25.0
    assert st.first_crossing(x, y, -1.0) == 0.0
    assert st.first_crossing(x, y, 4.0) == 10.0
    assert st.first_crossing(x, y, 9.0) == math.inf
    unknown = np.array([-np.inf, 4.0, -np.inf, 8.0])  # points that do not count
    assert st.first_crossing(x, unknown, 2.0) == 10.0
    assert st.first_crossing(x, unknown, 5.0) == 30.0


@pytest.mark.slow
@pytest.mark.parametrize(("seeds", "least", "most"), [(5, 0.87, 0.94), (30, 0.92, 0.96)])
def test_intervals_hold_the_truth_about_as_often_as_they_say(seeds, least, most, rng):
    """Nominal 95 %: right for many seeds, and known to fall short for five."""
    hits = 0
    for _ in range(600):
        found = st.estimate(rng.normal(size=seeds), st.Chance(rng, 400, 0.95))
        hits += found.low <= 0 <= found.high  # type: ignore[operator]
    assert least < hits / 600 < most


def test_corrected_p_values_are_wrong_no_more_often_than_they_say(rng):
    """By hand; and of three questions without an effect, one in twenty has an answer at most."""
    assert st.holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert st.holm([0.01, 0.011, 0.9]) == pytest.approx([0.03, 0.03, 0.9])  # never out of order
    assert st.holm([0.9, 0.5]) == pytest.approx([1.0, 1.0]) and st.holm([]) == []
    drawn = rng.random((4000, 3))
    wrong = np.mean([min(st.holm(p)) <= 0.05 for p in drawn])
    assert 0.035 < wrong < 0.06


def test_runs_are_set_against_one_policy_over_runs_and_episodes(rng):
    """Of two policies it is the paired t-test; with no chance in the episodes that of the runs."""
    x, y = rng.normal(size=(2, 30))
    found, p = st.paired(x, y, 0.9)
    test = stats.ttest_rel(x, y)
    assert p == pytest.approx(test.pvalue)
    assert (found.low, found.high) == pytest.approx(tuple(test.confidence_interval(0.9)))
    runs = rng.normal(size=6)
    found, p = st.paired(y, y - runs[:, None], 0.95)
    assert (found.value, p) == pytest.approx((runs.mean(), stats.ttest_1samp(runs, 0.0).pvalue))
    assert st.paired(y, y, 0.95) == (Estimate(0.0, 0.0, 0.0), 1.0)
    assert st.paired(y[None] + 1.0, y, 0.95) == (Estimate(pytest.approx(1.0)), 1.0)


def test_differences_over_runs_and_episodes_miss_the_truth_as_seldom_as_they_say(rng):
    """Runs vary, and in every episode one side has its own chance."""
    missed, tries, chance = 0, 100, st.Chance(rng, 400, 0.9)
    for _ in range(tries):
        runs, episodes = rng.normal(size=(2, 8, 1)), rng.normal(size=(2, 1, 30))
        x, y = runs + 2.0 * episodes + rng.normal(size=(2, 8, 30))
        found = st.difference_over_episodes(x, y, chance)
        means = x.mean(axis=1), y.mean(axis=1)
        assert found.value == pytest.approx(st.difference(*means, chance).value)
        missed += not found.low <= 0.0 <= found.high
    assert missed <= 25  # more has a chance of 1e-5 at 10 %; over runs alone it were 40
    alike = np.repeat(rng.normal(size=(2, 6, 1)), 30, axis=2)  # nothing but the runs counts
    found, of_runs = (
        call(x, y, st.Chance(np.random.default_rng(1), 4000, 0.9))
        for call, (x, y) in ((st.difference_over_episodes, alike), (st.difference, alike[:, :, 0]))
    )
    assert (found.low, found.high) == pytest.approx((of_runs.low, of_runs.high), abs=0.1)
    assert st.difference_over_episodes(x[:1], y, chance).low is None


@pytest.mark.parametrize(("of_runs", "of_episodes"), [(1.0, 0.1), (0.3, 1.0), (0.1, 3.0), (0, 0)])
def test_runs_that_are_no_better_are_seldom_said_to_be(of_runs, of_episodes, rng):
    """Runs, episodes and what is left of both vary; 5 % of the intervals may miss nothing."""
    missed, tries = 0, 400
    for _ in range(tries):
        shared = rng.normal(size=40)
        x = shared + of_runs * rng.normal(size=(5, 1)) + of_episodes * rng.normal(size=40)
        found, p = st.paired(x + rng.normal(size=(5, 40)), shared, 0.95)
        assert (p < 0.05) == (not found.low <= 0.0 <= found.high)
        missed += p < 0.05
    assert missed <= 32  # more has a chance of 0.3 % at 5 %
