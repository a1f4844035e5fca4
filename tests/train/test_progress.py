"""Long commands say how far they are, with a terminal and without one."""

import io
import time

import pytest
from rich.console import Console

from train.progress import progress


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    return now


def test_without_a_terminal_there_is_a_line_a_minute(clock):
    text = io.StringIO()
    with progress(Console(file=text, width=40), "episodes") as tell:
        for done in range(9):
            tell(done, 1200, "of [b] and a long name")
            clock[0] += 30.0
        clock[0] += 60.0
        tell(1203, 1200, "")  # a last batch may go beyond
    lines = text.getvalue().splitlines()
    assert len(lines) == 5
    assert lines[0] == "episodes: 2 of 1,200, of [b] and a long name; about 599.0 min left"
    assert lines[-1] == "episodes: 1,203 of 1,200; about 0.0 min left"
