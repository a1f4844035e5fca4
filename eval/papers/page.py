"""The papers' experiments: their numbers beside ours, as a page and as Markdown for docs/."""

from collections.abc import Sequence
from dataclasses import dataclass

from eval.page.html import render
from eval.papers.experiment import Finding


@dataclass(frozen=True)
class Section:
    """One experiment on the page.

    Attributes:
        name: an anchor.
        title: what it shows.
        about: what was done.
        findings: the paper's numbers beside ours.
        body: HTML if it is Markup; what went wrong, if anything did.
        command: that makes it.
        seconds: that it took.
        failed: whether there is nothing to show.
    """

    name: str
    title: str
    about: str
    findings: Sequence[Finding]
    body: str
    command: str
    seconds: float
    failed: bool = False

    @property
    def aims(self) -> list[Finding]:
        """The findings that have a target."""
        return [finding for finding in self.findings if finding.verdict != "shown"]

    @property
    def met(self) -> int:
        """How many of them met it."""
        return sum(finding.verdict == "met" for finding in self.aims)


@dataclass(frozen=True)
class Paper:
    """A paper and its experiments; `about` is what stands above them."""

    title: str
    about: str
    sections: Sequence[Section]


def page(papers: Sequence[Paper], command: str, seconds: float, quick: bool) -> str:
    """Lay out the page.

    Args:
        papers: what was run.
        command: that made the whole page.
        seconds: that everything took.
        quick: whether this is the quick form.
    """
    sections = [section for paper in papers for section in paper.sections]
    content = {"papers": papers, "sections": sections, "command": command, "seconds": seconds}
    return render("papers.html", title="The papers, reproduced", quick=quick, **content)


def summary(papers: Sequence[Paper]) -> str:
    """Return a Markdown table per paper, of every finding that has a number of the paper's."""
    return "\n\n".join(_table(paper) for paper in papers)


def _table(paper: Paper) -> str:
    lines = [f"**{paper.title}**", "", "|  |  | paper | ours | target |", "| --- " * 5 + "|"]
    for section in paper.sections:
        rows = [
            (finding.what, finding.paper, f"**{finding.ours}**",
             finding.target + (" (missed)" if finding.verdict == "missed" else ""))
            for finding in section.findings if finding.paper
        ]  # fmt: skip
        if section.failed:
            rows = [("did not run to the end", "", "", "")]
        for title, row in zip([section.title, *[""] * len(rows)], rows, strict=False):
            cells = [cell.replace("|", r"\|") for cell in (title, *row)]
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)
