"""Results of the papers' experiments are read as they were saved, or refused in one sentence."""

from pathlib import Path

import pytest
from markupsafe import Markup

from eval.papers.experiment import Finding, Result, Setting, experiment, judged, load, perform
from eval.papers.page import Paper, Section, page, summary
from eval.papers.registry import PAPERS, experiments
from fbid_gym.errors import RunError, UnknownOptionError

FINDINGS = [judged("what", "1", "2", "at most 1", False), Finding("else", "", "3")]


@experiment(
    "A title",
    """What was
    done.""",
)
def example(setting: Setting) -> Result:
    """Find a number."""
    setting.progress(0.5)
    body = [f"{setting.pick(3, 2)}<", Markup("<b>drawn</b>")]
    return Result(FINDINGS, {"best": 2.0, "none": float("inf")}, body)


def test_a_result_is_read_as_it_was_saved(tmp_path: Path) -> None:
    assert example.about == "What was done." and example.name == "example"
    assert load(example, tmp_path) is None
    perform(example, tmp_path, quick=True)
    found = load(example, tmp_path)
    assert found is not None
    run, body = found
    assert run.findings == FINDINGS and run.numbers == {"best": 2.0, "none": None}
    assert run.quick and run.seconds >= 0.0
    assert body == "2&lt;<b>drawn</b>"
    assert (example.folder(tmp_path) / "progress.json").is_file()


@pytest.mark.parametrize("content", [b"", b"{}", b"[]", b"\x00" * 99, b'{"findings": 3}'])
def test_damaged_results_are_refused_in_one_sentence(content: bytes, tmp_path: Path) -> None:
    perform(example, tmp_path, quick=False)
    (example.folder(tmp_path) / "numbers.json").write_bytes(content)
    with pytest.raises(RunError, match="example"):
        load(example, tmp_path)


def test_experiments_are_chosen_by_their_names_or_their_papers() -> None:
    every = experiments(PAPERS, ())
    assert [len(some) for _, some in every] == [11, 5]
    for _, some in every:
        for one in some:
            assert one.title and one.about and one.minutes > 0.0
            assert one.command(True) == f"python -m eval.papers --only {one.name} --quick"
    ((_, some),) = experiments(PAPERS, ("fig2_push", "garofalo2015"))
    assert some == every[1][1]
    with pytest.raises(UnknownOptionError, match="fig9.*fig2_push"):
        experiments(PAPERS, ("fig9",))


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
