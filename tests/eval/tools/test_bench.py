"""The benchmark's bookkeeping. What it measures is not tested: timings are no test."""

import numpy as np
import pytest

from eval.tools.bench.environments import by_layer
from eval.tools.bench.figures import Figure, Limit, Section, short
from eval.tools.bench.timing import Timed, in_turns, seconds_of


def test_cases_take_turns_in_alternating_order_after_one_warm_up() -> None:
    calls: list[str] = []
    measures = {
        "a": seconds_of(lambda: calls.append("a")),
        "b": seconds_of(lambda: calls.append("b"), before=lambda: calls.append("-")),
    }
    seconds = in_turns(measures, rounds=2)
    assert "".join(calls) in ("a-ba-b-ba", "-baa-b-ba")
    assert {name: values.shape for name, values in seconds.items()} == {"a": (2,), "b": (2,)}
    assert all((values >= 0).all() for values in seconds.values())


def test_what_is_timed_does_what_it_did() -> None:
    times = iter([1.0, 4.0, 10.0, 12.0])
    timed = Timed([1, 2], "index", lambda: next(times))
    assert (timed.index(2), timed.index(1), timed.count(2)) == (1, 0, 1)
    assert timed.seconds == 3.0 + 2.0


def test_a_figure_is_a_median_between_quartiles() -> None:
    figure = Figure.of("law", "3 µs", np.array([1.0, 5.0, 2.0, 4.0, 3.0]), Limit(2.5))
    assert (figure.low, figure.value, figure.high) == (2.0, 3.0, 4.0)


@pytest.mark.parametrize(
    ("limit", "text", "met", "missed"),
    [(Limit(0.35), "≤ 0.35", 0.35, 0.36), (Limit(4.5, at_least=True), "≥ 4.5", 4.5, 4.4)],
)
def test_limits(limit: Limit, text: str, met: float, missed: float) -> None:
    assert str(limit) == text
    assert limit.met_by(met) and not limit.met_by(missed)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (0.01234, "0.012"), (0.3456, "0.346"), (4.567, "4.57"), (123.4, "123"),
     (12345.0, "12345"), (-0.5, "-0.500")],
)  # fmt: skip
def test_three_significant_digits(value: float, text: str) -> None:
    assert short(value) == text


def test_a_table_names_what_missed_its_limit() -> None:
    figures = (
        Figure.of("fast", "1 µs", np.array([0.2]), Limit(0.35)),
        Figure.of("slow", "9 µs", np.array([1.0, 2.0, 3.0]), Limit(0.35)),
        Figure.of("free", "2 µs", np.array([1.0])),
    )
    lines = Section("Laws", "Per tick.", "x physics", figures).markdown().splitlines()
    assert lines[0] == "**Laws.** Per tick."
    assert lines[2] == "|  | cost | x physics | quartiles | limit |"
    assert lines[4:] == [
        "| fast | 1 µs | **0.200** |  | ≤ 0.35 |",
        "| slow | 9 µs | **2.00** | 1.50 – 2.50 | ≤ 0.35 (missed) |",
        "| free | 2 µs | **1.00** |  |  |",
    ]


def test_a_robot_without_an_environment_of_its_own_is_measured() -> None:
    figures = by_layer(["go1"], ["torque"], 1, 1).figures
    assert [figure.what for figure in figures] == ["go1, `torque`"]
