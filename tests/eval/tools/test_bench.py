"""The benchmark's bookkeeping. What it measures is not tested: timings are no test."""

import numpy as np

from eval.tools.bench.environments import by_layer
from eval.tools.bench.figures import Figure, Limit
from eval.tools.bench.timing import Timed, added, in_turns


def test_cases_take_turns_in_alternating_order_after_one_warm_up():
    calls: list[str] = []
    measures = {
        "a": added(lambda: None, lambda: calls.append("a"), 1, lambda: len(calls)),
        "b": added(lambda: calls.append("-"), lambda: calls.append("b"), 1, lambda: len(calls)),
    }
    seconds = in_turns(measures, rounds=2)
    assert "".join(calls) in ("a-ba-b-ba", "-baa-b-ba")
    assert {name: values.shape for name, values in seconds.items()} == {"a": (2,), "b": (2,)}
    assert all((values == 1).all() for values in seconds.values())


def test_what_is_timed_does_what_it_did():
    times = iter([1.0, 4.0, 10.0, 12.0])
    timed = Timed([1, 2], "index", lambda: next(times))
    assert (timed.index(2), timed.index(1), timed.count(2)) == (1, 0, 1)
    assert timed.seconds == 3.0 + 2.0


def test_a_figure_is_a_median_between_quartiles():
    figure = Figure.of("law", "3 µs", np.array([1.0, 5.0, 2.0, 4.0, 3.0]), Limit(2.5))
    assert (figure.low, figure.value, figure.high) == (2.0, 3.0, 4.0)


def test_a_robot_without_an_environment_of_its_own_is_measured():
    figures = by_layer(["go1"], ["torque"], 1, 1).figures
    assert [figure.what for figure in figures] == ["go1, `torque`"]
