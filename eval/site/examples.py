"""The page of the examples: their code, where a code host has links to it."""

import re
from pathlib import Path

_HEADING = re.compile(r"^## \[(.+?)\]\(\.\./examples/(\w+\.py)\)\n\n(.*?)(?=^## |\Z)", re.M | re.S)


def filled(text: str, folder: Path) -> str:
    """Return the page with the code of each example below what is said of it.

    Args:
        text: of the page; a section's heading links to `../examples/NAME.py`.
        folder: of the examples.
    """

    def section(found: re.Match[str]) -> str:
        title, name, said = found.groups()
        code = (folder / name).read_text(encoding="utf-8").strip()
        return f"## {title}\n\n{said.strip()}\n\n`examples/{name}`\n\n```python\n{code}\n```\n\n"

    return _HEADING.sub(section, text)
