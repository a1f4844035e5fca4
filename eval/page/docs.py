"""Pages of `docs/` whose tables a command writes, between two marks."""

import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path

from fbid_gym.errors import RunError
from train.runs.files import write

DOCS = Path(__file__).resolve().parents[2] / "docs"
BENCHMARK_PAGE = DOCS / "benchmark.md"
PAPERS_PAGE = DOCS / "papers.md"
ROBUSTNESS_PAGE = DOCS / "robustness.md"
RELIABILITY_PAGE = DOCS / "reliability.md"
POLICIES_PAGE = DOCS / "policies.md"

START, END = "<!-- tables: written by the command above -->", "<!-- end of tables -->"

_WIDEST = 110  # characters


def marks(part: str = "") -> tuple[str, str]:
    """Return the marks of a page's tables; of one part, where several commands write to a page."""
    named = f"tables of {part}" if part else "tables"
    return START.replace("tables", named), END.replace("tables", named)


def spliced(page: Path, tables: str, part: str = "") -> str:
    """Return a page's text with the tables between its marks.

    Raises:
        RunError: there is no such page, or it does not have the marks, once each and in order.
    """
    if not page.is_file():
        raise RunError(f"There is no page {page} to write tables into.")
    text, (first, last) = page.read_text(), marks(part)
    start, end = text.find(first), text.find(last)
    if not 0 <= start < end or text.count(first) != 1 or text.count(last) != 1:
        raise RunError(f"{page} needs the lines {first!r} and {last!r}, once each and in order.")
    return f"{text[: start + len(first)]}\n\n{tables}\n\n{text[end:]}"


def splice(page: Path, tables: str, part: str = "") -> None:
    """Write the tables into a page; raises as `spliced` does."""
    write(page, spliced(page, tables, part))


def markdown_table(
    heads: Sequence[str], rows: Iterable[Sequence[str]], left: int | None = None
) -> str:
    """Return a table as Markdown; of its columns, those after the first `left` are set right."""
    ruler = [*["---"] * len(heads[:left]), *["---:"] * (len(heads) - len(heads[:left]))]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (heads, ruler, *rows))


def command_block(words: Sequence[str]) -> str:
    """Return a command line as a block of Markdown that can be pasted, no wider than the pages."""
    lines = [""]
    for word in map(shlex.quote, words):
        if lines[-1].strip() and len(lines[-1]) + len(word) > _WIDEST:
            lines.append("   ")
        lines[-1] += f" {word}" if lines[-1] else word
    return "```\n" + " \\\n".join(lines) + "\n```"
