"""Tables in the README, between marks."""

import pytest

from eval.papers.page import Paper, Section
from eval.papers.parts import Finding, judged
from eval.papers.summary import summary
from eval.readme import BENCH, PAPERS, README, spliced
from fbid_gym.errors import RunError


def test_tables_replace_what_is_between_the_marks() -> None:
    readme = f"before\n{BENCH[0]}\nold\n{BENCH[1]}\nafter\n"
    once = spliced(readme, BENCH, "new")
    assert once == f"before\n{BENCH[0]}\n\nnew\n\n{BENCH[1]}\nafter\n"
    assert spliced(once, BENCH, "new") == once


@pytest.mark.parametrize("text", ["", BENCH[0], f"{BENCH[1]} {BENCH[0]}", "".join(BENCH) * 2])
def test_missing_or_doubled_marks_are_refused(text: str) -> None:
    with pytest.raises(RunError, match="once each"):
        spliced(text, BENCH, "new")


@pytest.mark.parametrize("marks", [BENCH, PAPERS])
def test_the_readme_has_the_marks(marks: tuple[str, str]) -> None:
    assert "tables" in spliced(README.read_text(), marks, "tables")


def test_the_summary_holds_every_number_that_the_paper_has() -> None:
    findings = [
        judged("hip | knee", "0.1 rad", "0.2 rad", "at most 0.1 rad", False),
        Finding("something of ours", "", "3"),
    ]
    section = Section("fig1", "Figure 1", "", findings, "", "python -m x", 75.0)
    broken = Section("fig2", "Figure 2", "", (), "", "python -m y", 0.0, failed=True)
    text = summary([Paper("A paper", "", [section, broken])])
    assert "| Figure 1 | hip \\| knee | 0.1 rad | **0.2 rad** | at most 0.1 rad (missed) |" in text
    assert "something of ours" not in text
    assert "| Figure 2 | did not run to the end |" in text
