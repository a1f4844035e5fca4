"""How numbers are written, and which finding is claimed when."""

import math

import pytest

from eval.results import Comparison, Crossing, Estimate, Layer, Pair, RunResult, Settings
from eval.wording import caution, count, crossing, duration, headline, number, percent, steps

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
        ([10.0, 20.0], Estimate(15, 10, 20), "15 (10 to 20)"),
        ([10.0], Estimate(10), "10"),
        ([math.inf], Estimate(math.inf), "not reached"),
        ([0.0, 0.0], Estimate(0, 0, 0), "reached before training"),
        ([math.inf] * 3, Estimate(math.inf, math.inf, math.inf), "not reached in 3 runs"),
        (
            [10.0, math.inf],
            Estimate(math.inf, 10, math.inf),
            "reached in 1 of 2 runs, first after 10",
        ),
        ([10.0, 20.0, math.inf], Estimate(20, 10, math.inf), "20 (10 to –), not reached in 1 of 3"),
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
        return Layer(name, {}, runs, {"returned": mean}, {"returned": 1.0}, None, None, None, None,
                     [], [])  # fmt: skip

    return Comparison(
        "e", {}, Settings(), [layer("first", one), layer("second", other)],
        [Pair("first", "second", Estimate(probability), difference, p_value)],
        None, 0.0, [], [], {}, {},
    )  # fmt: skip


def test_the_headline_claims_no_more_than_was_found() -> None:
    separated = comparison([400, 410], [300, 310], Estimate(100, 90, 110), 1.0, 1 / 3)
    assert headline(separated) == (
        "Every seed of first ended above every seed of second, by 100 points of return, but two "
        "seeds against two cannot rule out chance."
    )
    mixed = comparison([400, 290], [300, 310], Estimate(40, -20, 100), 0.5, 0.67)
    assert headline(mixed).startswith("No clear difference: first and second end 40 points")
    clear = comparison([400.0] * 5, [300.0] * 5, Estimate(100, 90, 110), 1.0, 2 / 252)
    assert headline(clear) == (
        "First ends 100 points of return above second, more than chance explains "
        f"(95{SPACE}% interval 90 to 110)."
    )
    single = comparison([400], [300], Estimate(100), 1.0, 1.0)
    assert "one run cannot say" in headline(single)


def test_caution_ends_at_five_seeds() -> None:
    nothing = Estimate(0, 0, 0)
    assert caution(comparison([1.0] * 5, [1.0] * 5, nothing, 0.5, 1)) is None
    text = caution(comparison([1.0] * 3, [1.0] * 5, nothing, 0.5, 1))
    assert text is not None and f"75{SPACE}%" in text and "three seeds" in text
