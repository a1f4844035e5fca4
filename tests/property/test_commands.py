"""Command lines of nonsense: each ends in one line on standard error and status 2."""

import contextlib
import io
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eval import compare, rollout
from eval.tools import ship
from eval.zero_actions.__main__ import main as zero_actions

NUMBERS = ("-1", "nan", "-inf", "", "one", "1e999", "0x10", "\0")
NAMES = ("", "horse", "../..", "\n", "é", "fbid_gym/Nothing-v0", "os:system", "%s", "\0")
# Of each command, what it is given besides, what takes a number above zero, and what takes a name.
Command = Callable[[list[str]], int]
COMMANDS: dict[Command, tuple[list[str], tuple[str, ...], tuple[str, ...]]] = {
    rollout.main: (
        ["--zero-action", "--env", "fbid_gym/QuadrupedWalk-v0"],
        ("--episodes",),
        ("--env", "--action-layer"),
    ),
    zero_actions: (["terrain"], ("--episodes", "--push"), ("--robots", "--only")),
    compare.main: (["runs/that/do/not/exist"], ("--episodes", "--samples"), ()),
    ship.main: (["runs/none", "--as", "QuadrupedWalk-v0/x"], ("--episodes", "--seed"), ("--as",)),
}


def _lines(command: Command) -> st.SearchStrategy[tuple[Command, list[str]]]:
    usual, numbers, names = COMMANDS[command]
    pairs = [[name, value] for name in numbers for value in NUMBERS]
    pairs += [[name, value] for name in names for value in NAMES]
    wrong = st.sampled_from([*pairs, ["--no-such-option"], ["--env-args", "{"]])
    return wrong.map(lambda options: (command, [*usual, *options]))


@given(line=st.sampled_from(list(COMMANDS)).flatmap(_lines))
def test_commands(line: tuple[Command, list[str]], tmp_path: Path) -> None:
    (command, words), errors = line, io.StringIO()
    with contextlib.chdir(tmp_path), contextlib.redirect_stdout(io.StringIO()):
        with contextlib.redirect_stderr(errors), pytest.raises(SystemExit) as stopped:
            raise SystemExit(command(words))
    assert stopped.value.code == 2 and "Traceback" not in errors.getvalue()
    assert not list(tmp_path.iterdir())
