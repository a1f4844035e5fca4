"""How numbers are written, and which finding is claimed when."""

import math
from dataclasses import replace

import pytest

from eval.report import caution, headline
from eval.results import Comparison, Crossing, Estimate, Layer, Pair, RunResult, Settings
from eval.wording import count, crossing, duration, form_of, number, percent, steps, titled
from train.episodes import Metric

SPACE = "\N{NO-BREAK SPACE}"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"), (1, "1"), (284.31, "284"), (12.345, "12.3"), (0.01234, "0.0123"),
        (1234567, "1,234,567"),
        (-0.5, "−0.5"), (1.0, "1"), (0.1 + 0.2, "0.3"), (1e-9, "0"), (-1e-9, "0"), (math.inf, "–"),
        (math.nan, "–"), (99.96, "100"), (100.0, "100"), (150, "150"),
    ],
)  # fmt: skip
def test_numbers(value: float, text: str) -> None:
    assert number(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (7.25, "7.2 s"), (42.4, "42 s"), (99.4, "99 s"), (99.6, "1 min 40 s"), (120, "2 min"),
        (3599.6, "1 h 0 min"), (4000, "1 h 7 min"), (math.inf, "not reached"),
    ],
)  # fmt: skip
def test_times(value: float, text: str) -> None:
    assert duration(value) == text.replace(" ", SPACE) or text == "not reached"


def test_steps_shares_and_counts() -> None:
    assert steps(392_000) == f"392{SPACE}k" and steps(1.46e6) == f"1.46{SPACE}M"
    assert steps(math.inf) == "not reached" and steps(12) == "12"
    assert percent(0.955) == f"96{SPACE}%" and percent(math.nan) == "–"
    assert count(1, "seed") == "one seed" and count(12, "seed") == "12 seeds"


@pytest.mark.parametrize(
    ("each", "median", "text"),
    [
        ([10.0, 20.0], Estimate(15, 10, 20), f"15 (10{SPACE}to{SPACE}20)"),
        ([10.0], Estimate(10), "10"),
        ([math.inf], Estimate(math.inf), "not reached"),
        ([0.0, 0.0], Estimate(0, 0, 0), "reached before training"),
        ([math.inf] * 3, Estimate(math.inf, math.inf, math.inf), "not reached in 3 runs"),
        (
            [10.0, math.inf],
            Estimate(math.inf, 10, math.inf),
            "reached in 1 of 2 runs, first after 10",
        ),
        (
            [10.0, 20.0, math.inf],
            Estimate(20, 10, math.inf),
            f"20 (10{SPACE}to{SPACE}–), not reached in 1 of 3",
        ),
    ],
)
def test_runs_that_did_not_get_there_are_mentioned(
    each: list[float], median: Estimate, text: str
) -> None:
    assert crossing(Crossing(each, median), number) == text


def comparison(
    one: list[float], other: list[float], difference: Estimate, probability: float, p_value: float
) -> Comparison:
    def layer(name: str, values: list[float]) -> Layer:
        runs = [
            RunResult("r", "r", k, 100, 1.0, {"returned": value}, [], [], [], [])
            for k, value in enumerate(values)
        ]
        mean = Estimate(sum(values) / len(values), min(values), max(values))
        metrics = {"returned": mean, "velocity_error": Estimate(math.nan)}
        return Layer(name, {}, runs, metrics, {"returned": 1.0}, None, None, None, None, [], [])

    return Comparison(
        "e", {}, Settings(), [layer("first", one), layer("second", other)],
        [Pair("first", "second", Estimate(probability), difference, p_value)],
        None, 0.0, [], [], {}, {},
    )  # fmt: skip


def test_the_headline_claims_no_more_than_was_found_and_tells_the_numbers() -> None:
    separated = comparison([400, 410], [300, 310], Estimate(100, 90, 110), 1.0, 1 / 3)
    assert headline(separated).startswith(
        "Every seed of first returns more than every seed of second, but"
    )
    assert "two against" not in headline(separated) and "cannot rule out" in headline(separated)
    assert headline(separated).endswith("return 405 against 305.")
    mixed = comparison([400, 290], [300, 310], Estimate(40, -20, 100), 0.5, 0.67)
    assert headline(mixed).startswith("No clear difference in return")
    clear = comparison([400.0] * 5, [300.0] * 5, Estimate(100, 90, 110), 1.0, 2 / 252)
    assert headline(clear).startswith("First returns more than second (p = 0.0079)")
    single = comparison([400], [300], Estimate(100), 1.0, 1.0)
    assert "one run cannot say" in headline(single)


def test_the_headline_shows_the_push_at_which_two_layers_differ_most() -> None:
    found = comparison([400.0] * 5, [300.0] * 5, Estimate(100, 90, 110), 1.0, 2 / 252)
    shares = ([1.0, 0.94, 0.5], [1.0, 0.22, 0.4])
    layers = [
        replace(layer, sweep=[Estimate(one) for one in its])
        for layer, its in zip(found.layers, shares, strict=True)
    ]
    text = headline(replace(found, layers=layers, sweep=[50.0, 200.0, 400.0]))
    assert f"94{SPACE}% against 22{SPACE}% stay up under pushes of 200 N" in text


@pytest.mark.parametrize(
    ("metric", "title", "text"),
    [
        (Metric("height_error", "height error", "m", -1), "height error, mm", "3.25"),
        (Metric("distance", "distance", "m", 0), "distance, m", "0.00325"),
        (Metric("velocity_error", "velocity error", "m/s", -1), "velocity error, m/s", "0.003"),
        (Metric("survived", "survival", "share", 1), "survival", f"0{SPACE}%"),
    ],
)
def test_errors_are_in_the_units_that_they_are_read_in(
    metric: Metric, title: str, text: str
) -> None:
    assert (titled(metric), form_of(metric)(0.00325)) == (title, text)


def test_caution_ends_at_five_seeds() -> None:
    nothing = Estimate(0, 0, 0)
    assert caution(comparison([1.0] * 5, [1.0] * 5, nothing, 0.5, 1)) == ""
    text = caution(comparison([1.0] * 3, [1.0] * 5, nothing, 0.5, 1))
    assert f"75{SPACE}%" in text and "three seeds" in text
