"""Tables in the pages of docs/, between marks."""

import shlex
from pathlib import Path

import pytest

from eval.page.docs import (
    BENCHMARK_PAGE,
    DOCS,
    END,
    PAPERS_PAGE,
    ROBUSTNESS_PAGE,
    START,
    command_block,
    splice,
    spliced,
)
from fbid_gym.errors import RunError


def test_tables_replace_what_is_between_the_marks(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{START}\nold\n{END}\nafter\n")
    for _ in range(2):
        splice(page, "new")
        assert page.read_text() == f"before\n{START}\n\nnew\n\n{END}\nafter\n"


@pytest.mark.parametrize("text", ["", START, f"{END} {START}", f"{START}{END}" * 2])
def test_missing_or_doubled_marks_are_refused(tmp_path: Path, text: str) -> None:
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(RunError, match="page.md needs .* once each"):
        splice(page, "new")
    assert page.read_text() == text


def test_a_page_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="no page .*missing.md"):
        spliced(tmp_path / "missing.md", "new")


PAGES = [BENCHMARK_PAGE, PAPERS_PAGE, ROBUSTNESS_PAGE]
PAGES += [DOCS / f"{name}.md" for name in ("walking", "terrain", "rates", "zoo")]


@pytest.mark.parametrize("page", [*PAGES, DOCS / "layer_benchmark.md"], ids=lambda page: page.stem)
def test_the_pages_have_the_marks(page: Path) -> None:
    assert "tables" in spliced(page, "tables")


@pytest.mark.parametrize("words", [["python"], ["a b", "c'd", "$e"], ["x" * 300, *["word"] * 90]])
def test_a_command_on_a_page_is_the_command(words: list[str]) -> None:
    first, *lines, last = command_block(words).splitlines()
    assert (first, last) == ("```", "```")
    assert shlex.split("\n".join(lines).replace("\\\n", "")) == words
    assert all(len(line) <= 115 for line in lines if "x" not in line)


def test_tables_say_of_which_run_they_are() -> None:
    """Nothing that a page says by hand can be wrong of another run."""
    zero_actions = [(f"zero_actions {page.stem}", page) for page in PAGES[3:]]
    for command, page in [("robustness", ROBUSTNESS_PAGE), *zero_actions]:
        _, _, written = page.read_text().partition(START)
        assert f"\n```\npython -m eval.{command} " in written.partition(END)[0]
