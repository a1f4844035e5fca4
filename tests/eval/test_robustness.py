"""Policies where one thing is otherwise: factors, what episodes say of them, page and errors."""

import csv
import json
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

from eval.results import Estimate
from eval.robustness.__main__ import RobustnessConfig, gathered, main
from eval.robustness.arms import zero_action
from eval.robustness.curves import Along, Budget, Robustness, Trend, area, estimated, meant, measure
from eval.robustness.factors import FACTORS, changed
from eval.robustness.page import page
from eval.robustness.tables import markdown, numbers, with_kept
from eval.robustness.wording import headline, leader
from eval.rollout import Player, play_player
from fbid_gym.errors import RunError, UnknownOptionError
from tests.eval.conftest import zero_policy
from tests.eval.study.small import fill
from train.runs.study import read_study

WALK, BALANCE = "fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedBalance-v0"
FACTOR = {factor.name: factor for factor in FACTORS}
SHORT = {"episode_seconds": 0.2}


def player(seconds: float = 0.2) -> Player:
    arm = zero_action(WALK, "joint_position", {"episode_seconds": seconds})
    return arm.players[0]


def at(own: Player, factor: str, value: float) -> Player:
    changes = FACTOR[factor].changes(value, meant(own))
    return replace(own, env_args=changed(own.env_args, changes))


def test_nothing_differs_at_a_nominal_value_and_something_at_the_ends():
    plain = meant(own := player()).resolved()
    for factor in FACTORS:
        for value in {factor.values[0], factor.values[-1], factor.nominal} - {None}:
            there = meant(at(own, factor.name, value)).resolved()
            assert (there == plain) == (value == factor.nominal), (factor.name, value)


def test_the_nominal_point_is_the_plain_evaluation_to_the_bit():
    own = player()
    plain = play_player(own, 3, seed=5).rows()
    for factor, value in (("friction", 1.0), ("slopes", 0.0), ("physics", 0.0)):
        assert play_player(at(own, factor, value), 3, seed=5).rows() == plain
    mass = replace(FACTOR["mass"], values=(0.0, 0.3))
    found = measure([zero_action(WALK, "joint_position", SHORT)], [mass], Budget(3, 5))
    for name in ("survived", "velocity_error"):
        (curve,) = found.along[0].curves[name].values()
        assert curve.points[0].value == np.mean([row[name] for row in plain])


def test_nothing_is_called_nominal_that_training_randomised(monkeypatch):
    once = play_player(player(0.1), 1, seed=5)
    monkeypatch.setattr("eval.robustness.curves.play_player", lambda *arguments: once)
    values = {"mass": (0.0, 0.3), "motor": (0.7, 1.0)}
    factors = [replace(FACTOR[name], values=its) for name, its in values.items()]
    for ranges, nominal in (({}, [0.0, 1.0]), ({"motor_strength": (0.8, 1.2)}, [0.0, None])):
        arms = [zero_action(WALK, "joint_position", {"randomisation": ranges})]
        found = measure(arms, factors, Budget(1, 5))
        assert [along.nominal for along in found.along] == nominal
        assert page(found).count("Upright: nothing differs") == 2 - nominal.count(None)


def test_found_is_reproducible_and_a_factor_does_not_feel_the_others():
    arms = [zero_action(WALK, "joint_position", SHORT)]
    both = [replace(FACTOR[name], values=(0.5, 1.0)) for name in ("push", "motor")]
    one, other = measure(arms, both, Budget(2, 5)), measure(arms, both[1:], Budget(2, 5))
    assert one.along[1] == other.along[0]
    assert one.to_dict() == measure(arms, both, Budget(2, 5)).to_dict()
    # So what is not tried anew can stay as it was written.
    rows = list(csv.DictReader(numbers(one).splitlines()))
    assert with_kept(other, rows).along == one.along
    with pytest.raises(RunError, match="kept do not fit"):
        with_kept(other, [{**row, "arm": "another"} for row in rows])


def test_robots_without_strength_or_under_huge_pushes_fall():
    own = player(2.0)
    assert play_player(at(own, "motor", 0.05), 2, seed=5).survived.max() == 0.0
    often = replace(own, env_args=own.env_args | {"push_interval": (0.2, 0.3)})
    strongest = play_player(at(often, "push", 0.8), 2, seed=5).strongest_push
    np.testing.assert_allclose(strongest, 0.8 * meant(own).load_robot().weight)
    assert play_player(at(often, "push", 8.0), 2, seed=5).survived.max() == 0.0
    assert play_player(at(often, "push", 0.0), 2, seed=5).survived.min() == 1.0


def test_the_area_is_the_mean_along_the_axis(rng):
    np.testing.assert_allclose(area(np.array([[0.0, 1.0, 1.0]]), [0.0, 1.0, 3.0]), 2.5 / 3.0)
    np.testing.assert_allclose(area(np.full((2, 4), 0.7), [-1.0, 0.0, 0.1, 5.0]), 0.7)
    np.testing.assert_allclose(area(np.array([[2.0], [3.0]]), [1.0]), [2.0, 3.0])
    # A straight line has the area of its middle, however it is divided.
    x = np.sort(rng.uniform(-2.0, 3.0, 9))
    np.testing.assert_allclose(area(3.0 * x[None] + 1.0, x), 1.5 * (x[0] + x[-1]) + 1.0)


def test_runs_are_the_units_of_chance_where_there_are_several(rng):
    table, x = rng.uniform(size=(3, 2, 40)), [0.0, 1.0, 4.0]
    curve, means = estimated(table, x, False, rng), table.mean(axis=2)
    for point, values in zip(curve.points, means, strict=True):
        assert point.value == pytest.approx(values.mean())
        assert (point.low, point.high) == pytest.approx((values.min(), values.max()))
    ends = [end(area(means.T, x)) for end in (np.min, np.max)]
    assert [curve.summary.low, curve.summary.high] == pytest.approx(ends)
    one = estimated(table[:, :1], x, False, rng)
    assert one.summary.value == pytest.approx(area(table[:, 0].mean(axis=1)[None], x)[0])
    assert one.summary.low < one.summary.value < one.summary.high
    change = estimated(table[:2, :1], x[:2], True, rng).summary
    assert change.value == pytest.approx((table[1, 0] - table[0, 0]).mean())
    assert estimated(table[:, :1, :1], x, False, rng).points[0].low is None


def flat(value: float, low: float, high: float) -> Trend:
    return Trend([Estimate(value, low, high)] * 2, Estimate(value, low, high))


def made(arms: dict[str, Trend], layer: str = "torque") -> Robustness:
    curves = {"survived": arms, "returned": arms}
    return Robustness(
        WALK, {}, Budget(4, 5), ("survived", "returned"), dict.fromkeys(arms, layer),
        dict.fromkeys(arms, ()), [Along("push", [0.0, 1.0], curves)], {},
    )  # fmt: skip


def test_an_arm_is_ahead_if_its_interval_lies_beyond_all_others():
    good, close = flat(0.9, 0.8, 1.0), flat(0.7, 0.6, 0.8)
    behind = {"a": good, "b": flat(0.5, 0.4, 0.79)}
    assert leader(made(behind).along[0], "survived") == "a"
    assert leader(made(behind | {"c": close}).along[0], "survived") == ""
    assert headline(made({"b": behind["b"], "a": good})).startswith("A stays up more often")
    assert "no arm clearly" in headline(made({"a": good, "b": close}))


SIZES = (62, 12)
STUDY = """
seeds = [0, 1, 2]
total_steps = 1000
[[arms]]
name = "one"
env = "fbid_gym/QuadrupedWalk-v0"
action_layer = "joint_position"
"""


def test_a_study_counts_its_finished_runs_and_a_policy_of_zeros_is_the_zero_action(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    file, out = tmp_path / "mine.toml", tmp_path / "new" / "page.html"
    file.write_text(STUDY)
    for cell in read_study(file).cells[:2]:
        fill(cell, 1.0, 0.1, policy=zero_policy(WALK, SIZES))
    arguments = [str(file), "--zero-action", "joint_position", "--factors", "physics"]
    budget = ["--episodes", "2", "--seconds", "0.1", "--out", str(out)]
    assert main([*arguments, *budget]) == 0
    assert "seed 2 of mine.toml has not finished" in capsys.readouterr().out.replace("\n", " ")
    found = json.loads(out.with_suffix(".json").read_text())
    assert [len(runs) for runs in found["runs"].values()] == [2, 0]
    for along in found["along"]:
        for curves in along["curves"].values():
            trained, zero = curves.values()
            for one, other in zip(trained["points"], zero["points"], strict=True):
                assert one["value"] == pytest.approx(other["value"], rel=1e-12)
    rows = list(csv.DictReader(out.with_suffix(".csv").read_text().splitlines()))
    assert len(rows) == 2 * 2 * (2 + 1)
    html = out.read_text()
    assert html.count("<svg") == 2 and "zero action</title>" in html


def test_arms_of_a_study_are_its_own(tmp_path, monkeypatch):
    """Also where their layer is the same, and another may have other arguments."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "mine.toml"
    arm = STUDY[STUDY.index("[[arms]]") :]
    quiet = arm.replace('"one"', '"quiet"') + "ppo = { log_std_init = -3.0 }\n"
    other = arm.replace('"one"', '"other"') + "env_args = { randomisation = { mass = 0.1 } }\n"
    file.write_text(STUDY.replace("[0, 1, 2]", "[0]") + quiet + other)
    for cell in read_study(file).cells:
        fill(cell, 1.0, 0.1, policy=zero_policy(WALK, SIZES))

    def found(*names: str) -> list[tuple[str, tuple[str, ...]]]:
        arms, _ = gathered(RobustnessConfig(runs=(file,), arms=names))
        return [(arm.name, arm.runs) for arm in arms]

    every = [(name, (f"QuadrupedWalk-v0-{name}-s0",)) for name in ("one", "quiet", "other")]
    assert found() == every
    assert found("quiet", "one") == every[:2]
    with pytest.raises(UnknownOptionError, match="Unknown arm 'loud'. Valid choices: one, quiet,"):
        found("loud")
    with pytest.raises(RunError, match="There are two arms 'one'"):
        gathered(RobustnessConfig(runs=(file, file)))


def test_what_an_environment_does_not_have_is_left_out_and_said():
    arms = [zero_action(BALANCE, "joint_position", {"episode_seconds": 0.1})]
    factors = [FACTOR[name] for name in ("mass", "delay", "slopes", "physics")]
    found = measure(arms, factors, Budget(1, 5))
    assert found.measures == ("survived", "returned")
    assert [along.name for along in found.along] == ["mass"]
    assert "does not leave level ground" in found.left_out["slopes"]
    assert "a zero action is the same" in found.left_out["delay"]
    assert "papers' physics anyway" in found.left_out["physics"]
    assert all(reason in unescape(page(found)) for reason in found.left_out.values())
    assert markdown(found).count("| mass |") == 2
