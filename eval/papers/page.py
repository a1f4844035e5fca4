"""The papers' experiments as one self-contained HTML page, a list of sections for each paper."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from eval.document import document
from eval.papers.parts import Finding, findings_table
from eval.wording import count, duration

_STYLE = """
h2.paper { font-size: 1.5rem; margin-top: 4rem; letter-spacing: -.012em; }
section { border-top: 1px solid var(--rule); margin-top: 3rem; max-width: none; }
section > * { max-width: 42rem; }
section > .wide { max-width: none; }
section > h2 { margin-top: 1.4rem; font-size: 1.15rem; }
h3 { font: 650 .92rem system-ui, sans-serif; margin: 2.2rem 0 .4rem; }
table.wrap td, table.wrap th { white-space: normal; text-align: left; min-width: 5rem; }
figure + p { margin-top: 1.6rem; }
img.strip { width: 100%; display: block; border-radius: 8px; }
.met { color: var(--c2); font-weight: 600; white-space: nowrap; }
.missed { color: var(--c5); font-weight: 600; white-space: nowrap; }
.shown { color: var(--faint); white-space: nowrap; }
nav ol { font: .86rem/1.7 system-ui, sans-serif; padding-left: 1.3rem; }
nav .state { color: var(--soft); }
"""


@dataclass(frozen=True)
class Section:
    """One experiment on the page.

    Attributes:
        name: an anchor.
        title: what it shows.
        about: what was done.
        findings: the paper's numbers beside ours.
        body: HTML; what went wrong, if anything did.
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


@dataclass(frozen=True)
class Paper:
    """A paper and its experiments."""

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
    body = [
        '<p class="eyebrow">The papers, reproduced</p>',
        "<h1>Every figure and claim of the papers' evaluations, beside what came out here</h1>",
        f'<div class="lede"><p>{escape(_summary(papers))}</p></div>',
    ]
    if quick:
        body.append(
            '<div class="callout"><b>The quick form.</b> Fewer robots, shorter runs and coarser '
            "sweeps, to see that everything works. The numbers that count come from the full form."
            "</div>"
        )
    for paper in papers:
        body.append(f'<h2 class="paper">{escape(paper.title)}</h2><p>{paper.about}</p>')
        body.append(_contents(paper))
        body += [_section(section) for section in paper.sections]
    body.append(f"<footer>Made by <code>{escape(command)}</code> in {duration(seconds)}.</footer>")
    return document("The papers, reproduced", "\n".join(body), style=_STYLE)


def _summary(papers: Sequence[Paper]) -> str:
    sections = [section for paper in papers for section in paper.sections]
    findings = [finding for section in sections for finding in section.findings]
    aims = [finding for finding in findings if finding.verdict != "shown"]
    met = sum(finding.verdict == "met" for finding in aims)
    broken = sum(section.failed for section in sections)
    parts = [
        f"{count(len(sections), 'experiment').capitalize()}; {met} of {len(aims)} targets met."
    ]
    if broken:
        parts.append(f"{count(broken, 'experiment').capitalize()} did not run to the end.")
    return " ".join(parts)


def _contents(paper: Paper) -> str:
    rows = []
    for section in paper.sections:
        aims = [finding for finding in section.findings if finding.verdict != "shown"]
        missed = sum(finding.verdict == "missed" for finding in aims)
        state = "failed" if section.failed else f"{len(aims) - missed} of {len(aims)} targets met"
        state = state if aims or section.failed else "no target"
        rows.append(
            f'<li><a href="#{escape(section.name)}">{escape(section.title)}</a> '
            f'<span class="state">· {state}</span></li>'
        )
    return f"<nav><ol>{''.join(rows)}</ol></nav>"


def _section(section: Section) -> str:
    parts = [
        f'<section id="{escape(section.name)}">',
        f"<h2>{escape(section.title)}</h2>",
        f"<p>{section.about}</p>",
        findings_table(section.findings) if section.findings else "",
        section.body,
        f"<pre>{escape(section.command)}  # {duration(section.seconds)}</pre>"
        if not section.failed
        else f"<pre>{escape(section.command)}</pre>",
        "</section>",
    ]
    return "\n".join(part for part in parts if part)
