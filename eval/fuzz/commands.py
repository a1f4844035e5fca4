"""Command lines of nonsense: each ends in one line on standard error and status 2."""

import contextlib
import io
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from eval import compare, rollout
from eval.zero_actions.__main__ import main as zero_actions

_WALK = ["--zero-action", "--env", "fbid_gym/QuadrupedWalk-v0"]
_MAINS: dict[str, tuple[Callable[[list[str]], int], list[str]]] = {
    "rollout": (rollout.main, _WALK),
    "walking": (zero_actions, ["walking"]),
    "terrain": (zero_actions, ["terrain"]),
    "compare": (compare.main, ["runs/that/do/not/exist"]),
}
# Of each command, what takes a number above zero, and what takes a name.
_OPTIONS = {
    "rollout": (("--episodes",), ("--env", "--action-layer")),
    "walking": (("--episodes", "--seconds"), ("--robots", "--layers")),
    "terrain": (("--episodes", "--push"), ("--robots", "--only")),
    "compare": ((), ()),
}
_NUMBERS = ("-1", "nan", "-inf", "", "one", "1e999", "0x10", "\0")
_NAMES = ("", "horse", "../..", "\n", "é", "fbid_gym/Nothing-v0", "os:system", "%s", "\0")

UNIT = "options"


def cases() -> st.SearchStrategy[dict[str, Any]]:
    """Return the choice of a command, and of options that it cannot take."""

    def options(command: str) -> st.SearchStrategy[list[str]]:
        numbers, names = _OPTIONS[command]
        pairs = [[name, value] for name in numbers for value in _NUMBERS]
        pairs += [[name, value] for name in names for value in _NAMES]
        return st.sampled_from([*pairs, ["--no-such-option"], ["--env-args", "{"]])

    return st.sampled_from(list(_MAINS)).flatmap(
        lambda command: st.fixed_dictionaries(
            {"command": st.just(command), "options": options(command)}
        )
    )


def amount(case: dict[str, Any]) -> int:
    """Return how many options of a case are nonsense: one."""
    return 1


def faults(case: dict[str, Any]) -> Iterator[str]:
    """Yield what goes wrong in a case, one sentence each."""
    main, fixed = _MAINS[case["command"]]
    errors, words = io.StringIO(), [*fixed, *case["options"]]
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
            try:
                status: Any = main(words)
            except SystemExit as stop:
                status = stop.code
        written = sorted(path.name for path in Path(folder).iterdir())
    if status != 2:
        yield f"{case['command']} {' '.join(words)!r}: exit status {status}"
    if "Traceback" in errors.getvalue():
        yield f"{case['command']} {' '.join(words)!r}: a traceback"
    if written:
        yield f"{case['command']} {' '.join(words)!r}: wrote {', '.join(written)}"
