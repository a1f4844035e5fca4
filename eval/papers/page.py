"""The papers' experiments: their numbers beside ours, as a page and as Markdown for docs/."""

from collections.abc import Sequence
from dataclasses import dataclass

from eval.page.docs import markdown_table
from eval.page.html import render
from eval.papers.experiment import Experiment, ExperimentRun, Finding
from eval.papers.registry import Paper


@dataclass(frozen=True)
class ExperimentSection:
    """One experiment on the page."""

    experiment: Experiment  # which
    run: ExperimentRun | None  # what it has left; None where it did not run to the end
    body: str  # HTML if it is Markup; what went wrong, if anything did
    command: str  # that makes it

    @property
    def findings(self) -> list[Finding]:
        """The paper's numbers beside ours."""
        return self.run.findings if self.run else []

    @property
    def aims(self) -> list[Finding]:
        """The findings that have a target."""
        return [finding for finding in self.findings if finding.verdict != "shown"]

    @property
    def met(self) -> int:
        """Number of them that met it."""
        return sum(finding.verdict == "met" for finding in self.aims)


Shown = Sequence[tuple[Paper, Sequence[ExperimentSection]]]
"""Papers with the sections of their experiments."""


def page(papers: Shown, command: str, seconds: float, quick: bool) -> str:
    """Lay out the page.

    Args:
        papers: what was run.
        command: that made the whole page.
        seconds: that everything took.
        quick: whether this is the quick form.
    """
    sections = [section for _, some in papers for section in some]
    content = {"papers": papers, "sections": sections, "command": command, "seconds": seconds}
    return render("papers.html", title="The papers, reproduced", quick=quick, **content)


def summary(papers: Shown) -> str:
    """Return a Markdown table per paper, of every finding that has a number of the paper's."""
    return "\n\n".join(_table(paper, some) for paper, some in papers)


def _table(paper: Paper, sections: Sequence[ExperimentSection]) -> str:
    lines = []
    for section in sections:
        rows = [
            (finding.what, finding.paper, f"**{finding.ours}**",
             finding.target + " (missed)" * (finding.verdict == "missed"))
            for finding in section.findings if finding.paper
        ]  # fmt: skip
        if section.run is None:
            rows = [("did not run to the end", "", "", "")]
        for title, row in zip([section.experiment.title, *[""] * len(rows)], rows, strict=False):
            lines.append([cell.replace("|", r"\|") for cell in (title, *row)])
    return f"**{paper.title}**\n\n{markdown_table(('', '', 'paper', 'ours', 'target'), lines)}"
