"""The papers' numbers beside ours as Markdown, for docs/papers.md."""

from collections.abc import Sequence

from eval.papers.page import Paper, Section
from eval.papers.parts import Finding


def summary(papers: Sequence[Paper]) -> str:
    """Return one table per paper with every finding that has a number of the paper's."""
    return "\n\n".join(_table(paper) for paper in papers)


def _table(paper: Paper) -> str:
    lines = [f"**{paper.title}**", "", "|  |  | paper | ours | target |"]
    lines += ["| --- " * 5 + "|"]
    lines += [line for section in paper.sections for line in _rows(section)]
    return "\n".join(lines)


def _rows(section: Section) -> list[str]:
    if section.failed:
        return [_row(section.title, "did not run to the end", "", "", "")]
    findings = [finding for finding in section.findings if finding.paper]
    titles = [section.title, *[""] * len(findings)]
    return [
        _row(title, finding.what, finding.paper, f"**{finding.ours}**", _target(finding))
        for title, finding in zip(titles, findings, strict=False)
    ]


def _target(finding: Finding) -> str:
    return finding.target + (" (missed)" if finding.verdict == "missed" else "")


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
