"""How numbers are written, and which finding is claimed when."""

import math

from eval.results import Estimate
from eval.robustness.curves import Trend
from eval.study.fresh import Falls
from eval.study.results import ArmFound, CellFound, Findings, Fresh, Settings
from eval.study.wording import headline
from eval.wording import interval, number
from tests.eval.test_robustness import made

SPACE = "\N{NO-BREAK SPACE}"


def test_numbers_and_runs_that_did_not_get_there():
    for value, text in {
        **{0: "0", 284.31: "284", 12.345: "12.3", 0.01234: "0.0123", 1234567: "1,234,567"},
        **{-0.5: "−0.5", 0.1 + 0.2: "0.3", -1e-9: "0", math.inf: "–", math.nan: "–", 99.96: "100"},
    }.items():
        assert number(value) == text
    assert interval(Estimate(20, 9, math.inf)) == f"20 (9{SPACE}to{SPACE}–)"


def findings(**returns: list[float]) -> Findings:
    """Arms by name, of so many runs with these returns in fresh episodes."""
    arms = []
    for name, its in returns.items():
        cells = [CellFound("", 0, "done", "", [], [], [], {}, "") for _ in its]
        final = {"return_mean": Estimate(sum(its) / len(its))}
        fresh = Fresh([""] * len(its), Falls(0, 4), {"return_mean": its}, final)
        arms.append(ArmFound("e", name, name, math.nan, cells, fresh=fresh))
    return Findings("", "", "second", Settings(samples=300), arms, [], {})


def test_the_headline_claims_no_more_than_was_found_and_tells_the_numbers():
    separated = findings(second=[300, 310], first=[400, 410])
    words = "Every seed of first returns more than every seed of second, but"
    assert headline(separated).startswith(words)
    assert "two against" not in headline(separated) and "cannot rule out" in headline(separated)
    assert headline(separated).endswith("return 405 against 305.")
    mixed = headline(findings(first=[400, 290], second=[300, 310]))
    assert mixed.startswith("No clear difference in return")
    clear = findings(first=[400.0] * 5, second=[300.0] * 5, third=[9.0])
    assert headline(clear).startswith("First returns more than second (p = 0.0079)")
    single = findings(first=[400], second=[300])
    assert "one run cannot say" in headline(single)
    assert headline(findings(first=[400, 410])) == "First over two seeds: return 405."
    its = {"first": (1.0, 0.9), "second": (1.0, 0.4)}
    curves = {name: Trend([*map(Estimate, own)], Estimate(0.5)) for name, own in its.items()}
    words = f"90{SPACE}% against 40{SPACE}% stay up under pushes of 1 times their weight, where"
    assert f"{words} they differ most." in headline(single, made(curves))
    curves["second"] = curves["first"]
    assert headline(single, made(curves)).endswith("pushes of 1 times their weight.")
