"""Tables that commands write into the README, each between marks of its own."""

from pathlib import Path

from eval.files import write
from fbid_gym.errors import RunError

README = Path(__file__).resolve().parents[1] / "README.md"

BENCH = ("<!-- bench: make bench ARGS=--write-readme -->", "<!-- end of bench -->")
PAPERS = ("<!-- papers: make papers ARGS=--write-readme -->", "<!-- end of papers -->")


def spliced(readme: str, marks: tuple[str, str], tables: str) -> str:
    """Return the README's text with the tables between the marks.

    Raises:
        RunError: the marks are not there, once each and in order.
    """
    start, end = (readme.find(mark) for mark in marks)
    if not 0 <= start < end or any(readme.count(mark) != 1 for mark in marks):
        raise RunError(f"The README needs the lines {marks[0]!r} and {marks[1]!r}, once each.")
    return f"{readme[: start + len(marks[0])]}\n\n{tables}\n\n{readme[end:]}"


def splice(marks: tuple[str, str], tables: str) -> None:
    """Write the tables into the README."""
    write(README, spliced(README.read_text(), marks, tables))
