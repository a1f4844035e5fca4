"""Table, curves and numbers of docs/ are of every cell, finished or not."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from eval.page.docs import DOCS, marks
from eval.page.figures import Series
from eval.study.__main__ import StudyConfig, main
from eval.study.cells import curve, exploring
from eval.study.pace import Pace
from eval.study.tables import drawn, table
from fbid_gym.errors import FbidError, RunError
from tests.eval.study.small import fill
from train.runs.folder import RunFolder
from train.runs.reading import load
from train.runs.study import arms, check_cells, read_study
from train.runs.training import standing


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


def test_arms_that_decide_more_often_are_drawn_over_the_same_time():
    pace = Pace.of([("slow", 1000.0), ("fast", 5000.0)])
    its = Series("fast", 0, [0.0, 50.0], [4000.0, 4500.0], singles=[([5.0], [2500.0])])
    returns, errors = pace.scaled(its, "return_mean"), pace.scaled(its, "velocity_error")
    np.testing.assert_allclose((returns.x, returns.value), ([0.0, 10.0], [800.0, 900.0]))
    np.testing.assert_allclose(returns.singles, [([1.0], [500.0])])
    np.testing.assert_allclose((errors.x, errors.value), ([0.0, 10.0], its.value))
    np.testing.assert_allclose(pace.scaled(its, "return_mean", over_steps=False).x, its.x)
    assert pace.titled("return", "return_mean") == "return of 1,000"
    for alike in ([("one", 7.0), ("two", 7.0)], [("one", float("nan")), ("two", 7.0)]):
        pace = Pace.of(alike)
        same = pace.scaled(replace(its, name="two"), "return_mean").value
        np.testing.assert_allclose(same, its.value)
        assert pace.titled("return", "return_mean") == "return"


def test_what_has_only_begun_does_not_cut_short_what_has_finished(study):
    first, _, second = study.cells
    fill(first, 10.0, 0.1)
    fill(second, 20.0, 0.3, until=900)
    walks = arms(study)[0]
    assert curve(walks, "velocity_error").values.tolist() == [[0.2, 0.1]]
    assert "| one | 1 of 2 finished |" in table(study)


def test_docs_are_written_whole_or_not_at_all(study, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(main.__globals__, "DOCS", tmp_path / "docs")
    (tmp_path / "docs").mkdir()
    page_of_docs = tmp_path / "docs" / "mine.md"
    first, last = marks("mine")
    config = StudyConfig(tmp_path / "mine.toml", tmp_path / "out", write_docs=True)
    with pytest.raises(FbidError, match="There is no page"):
        main(config)
    page_of_docs.write_text(f"{first}\n{last}\n")
    with pytest.raises(FbidError, match="has not been evaluated yet"):
        main(config)
    assert [path.name for path in page_of_docs.parent.iterdir()] == ["mine.md"]
    fill(study.cells[0], 10.0, 0.1)
    assert main(config) == 0
    assert table(study) in page_of_docs.read_text()
    assert {path.suffix for path in page_of_docs.parent.iterdir()} == {".md", ".svg"}
    with pytest.raises(FbidError, match="Invalid --robustness"):
        main(replace(config, write_docs=False, robustness=True))


def test_curves_hold_the_evaluations_that_all_seeds_had(study):
    """One that goes on beyond what it was to take was evaluated once more where that ended."""
    first, _, second = study.cells
    fill(first, 10.0, 0.1)
    fill(second, 20.0, 0.3)
    file = RunFolder.of(second.config.folder).evaluations
    head, before, after = file.read_text().splitlines()
    middle = before.replace("0,", "500,", 1)
    file.write_text("\n".join([head, before, middle, after]) + "\n")
    walks, _ = arms(study)
    assert curve(walks, "velocity_error").values.tolist() == [[0.2, 0.1], [0.6, 0.3]]
    assert np.isnan(curve(walks, "what nobody measured").values).all()
    file.write_text("\n".join([head, before.replace(",8,", ",x,"), after]) + "\n")
    with pytest.raises(RunError, match="evaluations.csv: column 'episodes' holds more than"):
        curve(walks, "velocity_error")


STUDIES = sorted((DOCS.parent / "studies").glob("*.toml"))


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_kept_runs_are_those_of_their_study(path):
    study = read_study(path)
    check_cells(study)
    for cell in study.cells:
        if standing(cell.config).state == "done":
            assert load(cell.config.folder).seed == cell.config.seed
