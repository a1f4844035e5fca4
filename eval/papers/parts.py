"""The pieces that a section of the page is made of, as HTML."""

import base64
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Literal, TypeVar

import numpy as np
from PIL import Image

Row = TypeVar("Row")
Verdict = Literal["met", "missed", "shown"]

_MARK = {"met": "✓ met", "missed": "✗ missed", "shown": "shown"}


@dataclass(frozen=True)
class Finding:
    """One number of a paper beside ours.

    Attributes:
        what: is measured.
        paper: what the paper has.
        ours: what came out here.
        verdict: "met" or "missed" where ours has a target, else "shown".
        target: what ours should be; empty without a target.
    """

    what: str
    paper: str
    ours: str
    verdict: Verdict = "shown"
    target: str = ""


def judged(what: str, paper: str, ours: str, target: str, holds: bool) -> Finding:
    """Return a finding that has a target."""
    return Finding(what, paper, ours, "met" if holds else "missed", target)


def fate(fell: float | None) -> str:
    """Say whether a robot stayed up; `fell` is when it fell, s."""
    return "stays up" if fell is None else f"falls at {fell:.1f} s"


def findings_table(findings: Sequence[Finding]) -> str:
    """The paper's numbers beside ours."""
    rows = [
        [
            escape(finding.what),
            escape(finding.paper),
            f"<b>{escape(finding.ours)}</b>",
            escape(finding.target),
            f'<span class="{finding.verdict}">{_MARK[finding.verdict]}</span>',
        ]
        for finding in findings
    ]
    return table(["", "paper", "ours", "target", ""], rows, wrap=True)


def table(heads: Sequence[str], rows: Sequence[Sequence[str]], wrap: bool = False) -> str:
    """A table.

    Args:
        heads: plain text.
        rows: cells that are already HTML; the first of a row is its heading.
        wrap: let long cells break into lines.
    """
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join(
        f"<tr><th>{row[0]}</th>{''.join(f'<td>{cell}</td>' for cell in row[1:])}</tr>"
        for row in rows
    )
    kind = ' class="wrap"' if wrap else ""
    return (
        f'<div class="scroll wide"><table{kind}><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def columns(
    rows: Iterable[Row], cells: Sequence[tuple[str, Callable[[Row], str]]], wrap: bool = False
) -> str:
    """A table of rows, from the heading of each column and what stands in it."""
    return table([head for head, _ in cells], [[of(row) for _, of in cells] for row in rows], wrap)


def text(*paragraphs: str) -> str:
    """Paragraphs of HTML."""
    return "".join(f"<p>{paragraph}</p>" for paragraph in paragraphs)


def heading(words: str) -> str:
    """A heading within a section."""
    return f"<h3>{escape(words)}</h3>"


def figure(charts: Sequence[str], caption: str, columns: int = 2) -> str:
    """Charts side by side, with what they show below."""
    grid = {1: "one", 2: "grid2", 3: "grid3"}[columns]
    width = ' class="wide"' if columns > 1 else ""
    return (
        f'<figure{width}><div class="{grid}">{"".join(charts)}</div>'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def frames(images: Sequence[np.ndarray], caption: str, alternative: str) -> str:
    """Pictures side by side in one strip.

    Args:
        images: (H, W, 3) uint8 each, all of one size.
        caption: HTML.
        alternative: plain text for those who do not see the strip.
    """
    buffer = io.BytesIO()
    Image.fromarray(np.concatenate(list(images), axis=1)).save(buffer, "JPEG", quality=82)
    data = base64.b64encode(buffer.getvalue()).decode()
    width = 11 * len(images)  # rem, so that a short strip is no wall
    return (
        f'<figure class="wide"><img class="strip" style="max-width:{width}rem" '
        f'alt="{escape(alternative)}" src="data:image/jpeg;base64,{data}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def video(mp4: bytes, caption: str) -> str:
    """A clip that plays when asked to."""
    data = base64.b64encode(mp4).decode()
    return (
        f'<figure class="one"><video muted loop playsinline controls preload="metadata" '
        f'src="data:video/mp4;base64,{data}"></video><figcaption>{caption}</figcaption></figure>'
    )


def folded(summary: str, content: str) -> str:
    """Content that is hidden until asked for."""
    return f"<details><summary>{escape(summary)}</summary>{content}</details>"
