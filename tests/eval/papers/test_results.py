"""Results of the papers' experiments are read as they were saved, or refused in one sentence."""

from pathlib import Path

import pytest
from markupsafe import Markup

from eval.papers.experiment import Experiment, Result, drawn, load, save
from eval.papers.page import Finding, Paper, Section, judged, page, summary
from fbid_gym.errors import RunError


def show(result: Result) -> list[str]:
    return [f"{result.numbers['best']:.3f}", f"{result.arrays['error'].mean():.3f}<"]


EXPERIMENT = Experiment("eval.papers.some.example", "A", "B.", run=lambda setting: None, show=show)  # type: ignore[arg-type, return-value]


def test_a_result_is_read_as_it_was_saved(tmp_path: Path) -> None:
    result = Result([], {"best": 2.0}, {"error": [1.0, 2.0]})
    save(EXPERIMENT, tmp_path, result, {"quick": True, "seconds": 3.0})
    read, run = load(EXPERIMENT, tmp_path)
    assert (run.quick, run.seconds) == (True, 3.0)
    assert drawn(EXPERIMENT, read) == "2.0001.500&lt;"


@pytest.mark.parametrize("name", ["numbers.json", "data.npz"])
@pytest.mark.parametrize("content", [b"", b"{}", b"[]", b"PK\x03\x04", b"\x93NUMPY", b"\x00" * 99])
def test_damaged_results_are_refused_in_one_sentence(
    name: str, content: bytes, tmp_path: Path
) -> None:
    result = Result([], {"best": 2.0}, {"error": [1.0, 2.0]})
    save(EXPERIMENT, tmp_path, result, {"quick": True, "seconds": 3.0})
    (EXPERIMENT.folder(tmp_path) / name).write_bytes(content)
    with pytest.raises(RunError, match=name):
        load(EXPERIMENT, tmp_path)


@pytest.mark.parametrize("numbers", [{}, {"best": "x"}, {"best": None}])
def test_results_of_something_else_are_refused(numbers: dict, tmp_path: Path) -> None:
    with pytest.raises(RunError, match="example: its data do not fit it"):
        drawn(EXPERIMENT, Result([], numbers, {"error": []}))


def test_page_and_summary_hold_every_number_that_the_paper_has() -> None:
    findings = [
        judged("hip | knee", "0.1 rad", "0.2 rad", "at most 0.1 rad", False),
        Finding("something of ours", "", "3"),
    ]
    body = Markup("<p>drawn</p>")
    section = Section("fig1", "Figure 1", "", findings, body, "python -m x", 75.0)
    broken = Section("fig2", "Figure 2", "", (), "<b>", "python -m y", 0.0, failed=True)
    papers = [Paper("A paper", "", [section, broken])]
    text = summary(papers)
    assert "| Figure 1 | hip \\| knee | 0.1 rad | **0.2 rad** | at most 0.1 rad (missed) |" in text
    assert "something of ours" not in text and "| Figure 2 | did not run to the end |" in text
    html = page(papers, "python -m eval.papers", 80.0, quick=False)
    assert "0 of 1 targets met" in html and "One experiment did not run to the end" in html
    assert "<p>drawn</p>" in html and "&lt;b&gt;" in html and "something of ours" in html
