"""What the runs of a study say together is what was evaluated."""

import json
from dataclasses import replace

import pytest

from eval.results import Estimate
from eval.study.findings import findings
from eval.study.page import page
from fbid_gym.errors import FbidError
from tests.eval.study.small import ALIKE, FEW, fill, written
from train.runs.endpoints import register
from train.runs.folder import RunFolder


def test_the_numbers_of_an_arm_are_of_the_trainings_that_are_done(study):
    first, squat, second = study.cells
    fill(first, 10.0, 0.1)
    fill(second, 20.0, 0.3, until=900)  # evaluated, but not to its end
    walks, squats = findings(study, FEW).arms
    assert walks.counted == [first.config.folder.name]
    assert (walks.done, walks.complete) == (1, False)
    assert walks.final["velocity_error"] == Estimate(0.1)
    assert walks.before["velocity_error"] == 0.2 and walks.final["falls"].value == 0.0
    assert [cell.state for cell in walks.cells] == ["done", "90%"]
    assert (squats.counted, squats.cells[0].state) == ([], "not begun")


def test_thresholds_are_reached_by_who_stays_up(study):
    """Half the episodes fall at the first evaluation, where the error is twice as large."""
    first, _, second = study.cells
    fill(first, 10.0, 0.1)
    fill(second, 10.0, 0.2)
    settings = replace(FEW, thresholds=(0.5, 0.2, 0.15, 0.05))
    arm = findings(study, settings).arms[0]
    inf = float("inf")
    reached = [[1000, 1000], [1000, 1000], [1000, inf], [inf, inf]]
    assert [one.each for one in arm.steps_to] == reached
    assert arm.wall_to[0].each == [9.0, 9.0]
    assert arm.falls_to == []  # they were not counted
    for cell in (first, second):
        table = RunFolder.of(cell.config.folder).progress
        table.write_text("steps,falls,return_mean\n500,40,1\n1000,60,2\n")
    counted = findings(study, settings).arms[0].falls_to
    assert [one.each for one in counted[:2]] == [[60, 60], [60, 60]]
    lenient = findings(study, replace(settings, survival=0.5)).arms[0]
    assert [one.each for one in lenient.steps_to[:2]] == [[0, 0], [0, 1000]]
    assert lenient.steps_to[2].each[0] == pytest.approx(500.0)


def test_arms_are_set_against_the_reference(tmp_path):
    study = written(tmp_path, ALIKE)
    for cell in study.cells:
        fill(cell, 10.0 + cell.config.seed, 0.1 if cell.arm == "other" else 0.2)
    one, other = findings(study, FEW).arms
    assert study.reference == "one" and not one.versus
    assert other.versus["velocity_error"].probability == Estimate(1.0, 1.0, 1.0)
    assert other.versus["return_mean"].probability.value == 0.5
    back, _ = findings(study, FEW, "other").arms
    assert back.versus["velocity_error"].probability.value == 0.0
    with pytest.raises(FbidError, match="Unknown reference 'cat'. Valid choices: one, other"):
        findings(study, FEW, "cat")


def test_a_folder_of_another_study_is_one_clear_error(study, tmp_path):
    first = study.cells[0]
    fill(first, 10.0, 0.1)
    config = RunFolder.of(first.config.folder).config
    mine = json.loads(config.read_text())
    for changes, message in (
        ({"num_envs": 3}, "num_envs 512 instead of 3"),
        ({"total_steps": 5000}, "total_steps 1000 instead of 5000"),
    ):
        config.write_text(json.dumps(mine | changes))
        with pytest.raises(FbidError, match=f"is not what the study says.*{message}") as caught:
            findings(study, FEW)
        assert str(first.config.folder) in str(caught.value)
    config.write_text(json.dumps(mine | {"total_steps": 500}))  # will be continued
    findings(study, FEW)


def test_returns_are_compared_as_shares_of_what_can_be_earned(tmp_path):
    """An arm that decides five times as often adds up five times as many rewards."""
    study = written(tmp_path, f"{ALIKE}env_args = {{ policy_hz = 250 }}\n")
    for cell in study.cells:
        fill(cell, 10.0 if cell.arm == "one" else 40.0, 0.1)
    slow, quick = findings(study, FEW).arms
    assert (slow.most, quick.most) == (1000.0, 5000.0)
    assert quick.versus["return_mean"].probability.value == 0.0


def test_an_endpoint_is_answered_when_both_arms_are_done(tmp_path):
    asked = '[[endpoints]]\nmeasure = "{}"\narm = "other"\nagainst = "one"\n'
    study = written(tmp_path, ALIKE + asked.format("velocity_error") + asked.format("slip"))
    register(study.name, study.runs, study.endpoints)
    assert findings(study, FEW).answers == []
    for cell in study.cells:
        fill(cell, 10.0, 0.1 if cell.arm == "other" else 0.2)
    found = findings(study, FEW)
    (answer,) = found.answers  # of slip there is no column
    assert answer.means == pytest.approx((0.1, 0.2)) and not answer.fresh
    assert answer.difference.value == pytest.approx(-0.1)
    assert answer.corrected == pytest.approx(2 * answer.p_value) == pytest.approx(2 / 3)
    assert "What was asked" in page(found)
