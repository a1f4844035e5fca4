"""How numbers are written, and which finding is claimed when."""

import math

from eval.report import headline
from eval.results import Comparison, Crossing, Estimate, Layer, Pair, RunResult, Settings
from eval.wording import crossing, number

SPACE = "\N{NO-BREAK SPACE}"


def test_numbers_and_runs_that_did_not_get_there():
    for value, text in {
        **{0: "0", 284.31: "284", 12.345: "12.3", 0.01234: "0.0123", 1234567: "1,234,567"},
        **{-0.5: "−0.5", 0.1 + 0.2: "0.3", -1e-9: "0", math.inf: "–", math.nan: "–", 99.96: "100"},
    }.items():
        assert number(value) == text
    never, to = math.inf, f"{SPACE}to{SPACE}"
    for each, median, text in (
        ([10.0, 20.0], Estimate(15, 10, 20), f"15 (10{to}20)"),
        ([never], Estimate(never), "not reached"),
        ([0.0, 0.0], Estimate(0, 0, 0), "reached before training"),
        ([10.0, never], Estimate(never, 10, never), "reached in 1 of 2 runs, first after 10"),
        ([9.0, 20.0, never], Estimate(20, 9, never), f"20 (9{to}–), not reached in 1 of 3"),
    ):
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


def test_the_headline_claims_no_more_than_was_found_and_tells_the_numbers():
    separated = comparison([400, 410], [300, 310], Estimate(100, 90, 110), 1.0, 1 / 3)
    words = "Every seed of first returns more than every seed of second, but"
    assert headline(separated).startswith(words)
    assert "two against" not in headline(separated) and "cannot rule out" in headline(separated)
    assert headline(separated).endswith("return 405 against 305.")
    mixed = comparison([400, 290], [300, 310], Estimate(40, -20, 100), 0.5, 0.67)
    assert headline(mixed).startswith("No clear difference in return")
    clear = comparison([400.0] * 5, [300.0] * 5, Estimate(100, 90, 110), 1.0, 2 / 252)
    assert headline(clear).startswith("First returns more than second (p = 0.0079)")
    single = comparison([400], [300], Estimate(100), 1.0, 1.0)
    assert "one run cannot say" in headline(single)
