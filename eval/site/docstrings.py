"""Docstrings of environments as Markdown: their sections, tables with one line a row."""

import inspect
import re


def sections(described: type) -> dict[str, str]:
    """Return the sections of an environment's docstring, name -> Markdown.

    What stands before the first heading is the section "".
    """
    parts = re.split(r"^## (.+)\n", inspect.getdoc(described) or "", flags=re.MULTILINE)
    named = {"": parts[0]} | dict(zip(parts[1::2], parts[2::2], strict=True))
    return {name: _joined_rows(text.strip()) for name, text in named.items()}


def _joined_rows(text: str) -> str:
    """Markdown whose table rows lie on one line each.

    A docstring breaks long rows: a row goes on where its first cell is empty, or where the first
    cell before it ends with a comma.
    """
    lines: list[str] = []
    for line in text.splitlines():
        row = _cells(line)
        last = _cells(lines[-1]) if lines else []
        if row and last and len(row) == len(last) and (not row[0] or last[0].endswith(",")):
            joined = [f"{a} {b}".strip() for a, b in zip(last, row, strict=True)]
            lines[-1] = f"| {' | '.join(joined)} |"
        else:
            lines.append(line)
    return "\n".join(lines)


def _cells(line: str) -> list[str]:
    """Of a row of a table; none of any other line, or of the rule below a header."""
    bare = line.strip()
    if not (bare.startswith("|") and bare.endswith("|")) or set(bare) <= set("|-: "):
        return []
    return [cell.strip() for cell in bare[1:-1].split("|")]
