"""Tables in the pages of docs/, between marks."""

import shlex

import pytest

from eval.page.docs import END, START, command_block, splice
from fbid_gym.errors import RunError


def test_tables_replace_what_is_between_the_marks(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{START}\nold\n{END}\nafter\n")
    for _ in range(2):
        splice(page, "new")
        assert page.read_text() == f"before\n{START}\n\nnew\n\n{END}\nafter\n"


@pytest.mark.parametrize("text", ["", START, f"{END} {START}", f"{START}{END}" * 2])
def test_missing_or_doubled_marks_are_refused(tmp_path, text):
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(RunError, match="page.md needs .* once each"):
        splice(page, "new")
    assert page.read_text() == text


@pytest.mark.parametrize("words", [["python"], ["a b", "c'd", "$e"], ["x" * 300, *["word"] * 90]])
def test_a_command_on_a_page_is_the_command(words):
    first, *lines, last = command_block(words).splitlines()
    assert (first, last) == ("```", "```")
    assert shlex.split("\n".join(lines).replace("\\\n", "")) == words
    assert all(len(line) <= 115 for line in lines if "x" not in line)
