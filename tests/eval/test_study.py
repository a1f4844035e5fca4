"""What a study shows is what was evaluated, of every cell, finished or not."""

import csv
import io
import re
from xml.etree import ElementTree

import pytest

from eval.study import arms, curve, drawn, exploring, numbers, table
from fbid_gym.errors import FbidError
from train.runs.folder import RunFolder
from train.runs.study import read_study

STUDY = """
seeds = [0, 1]
total_steps = 1000
[[arms]]
name = "one"
env = "fbid_gym/QuadrupedWalk-v0"
action_layer = "torque"
[[arms]]
name = "other"
env = "fbid_gym/BipedSquat-v0"
action_layer = "torque"
seeds = [0]
"""
COLUMNS = ("steps,wall_seconds,episodes,return_mean,return_std,return_q25,return_q75,length_mean,"
           "survival,velocity_error\n")  # fmt: skip


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(STUDY)
    return read_study(path, tmp_path / "out")


def fill(cell, height, error, until=1000):
    folder = RunFolder.of(cell.config.folder)
    folder.path.mkdir(parents=True)
    folder.evaluations.write_text(
        f"{COLUMNS}0,0,8,{height},1,{height - 1},{height + 1},50,0.5,{2 * error}\n"
        f"1000,9,8,{2 * height},1,{height - 1},{height + 1},50,1.0,{error}\n"
    )
    folder.progress.write_text(f"steps,return_mean\n400,nan\n800,{height / 2}\n{until},{height}\n")


def test_numbers_hold_every_evaluation(study):
    for height, cell in zip((10.0, 20.0, 30.0), study.cells, strict=True):
        fill(cell, height, 0.1)
    rows = list(csv.DictReader(io.StringIO(numbers(study))))
    assert [(row["env"], row["arm"], row["seed"], float(row["return_mean"])) for row in rows] == [
        (cell.config.env, cell.arm, str(cell.config.seed), factor * height)
        for height, cell in zip((10.0, 20.0, 30.0), study.cells, strict=True)
        for factor in (1.0, 2.0)
    ]
    assert [row["return_exploring"] for row in rows][:4] == ["", "10.0", "", "20.0"]


def test_curves_are_means_over_seeds_between_the_worst_and_the_best(study):
    first, squat, second = study.cells
    fill(first, 10.0, 0.1)
    fill(second, 20.0, 0.3)
    fill(squat, 5.0, float("nan"))
    walks, squats = arms(study)
    assert curve(walks, "velocity_error").values.tolist() == [[0.2, 0.1], [0.6, 0.3]]
    assert exploring(first.config) == ([800.0, 1000.0], [5.0, 10.0])
    text = table(study)
    assert "| QuadrupedWalk-v0 | one | 2 | 1" in text
    assert "0.400 → 0.200 (0.100 to 0.300)" in text
    assert "| BipedSquat-v0 | other | 1 |" in text and "| – |" in text
    picture = ElementTree.fromstring(drawn(study))
    # Where nothing is commanded there is no velocity error to draw.
    assert len(picture.findall("{http://www.w3.org/2000/svg}svg")) == 3
    assert squats.cells == (squat,)


def test_what_is_not_finished_counts_with_what_it_has_and_is_said(study):
    fill(study.cells[0], 10.0, 0.1, until=900)
    assert "0 of 2 finished" in table(study)
    drawn(study)


def test_a_study_without_runs_is_said(study):
    assert "| none |" in table(study)
    with pytest.raises(FbidError, match=re.escape("has not been evaluated yet")):
        drawn(study)
