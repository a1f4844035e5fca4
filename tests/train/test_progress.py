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
    lines = text.getvalue().splitlines()
    assert len(lines) == 4
    assert lines[0] == "episodes: 2 of 1,200, of [b] and a long name; about 599.0 min left"


def test_the_time_left_is_by_what_was_done_since_it_began(clock):
    text = io.StringIO()
    with progress(Console(file=text), "steps", every=2.0, start=900) as tell:
        clock[0] += 60.0
        tell(1000, 1200, "return 5")
    assert text.getvalue() == "steps: 1,000 of 1,200, return 5; about 2.0 min left\n"


def test_what_is_over_within_a_minute_says_nothing(clock):
    text = io.StringIO()
    with progress(Console(file=text), "episodes") as tell:
        for done in range(50):
            tell(done, 50, "")
            clock[0] += 1.0
    assert text.getvalue() == ""


def test_with_a_terminal_there_is_a_bar_and_it_goes_away():
    text = io.StringIO()
    console = Console(file=text, force_terminal=True, width=100)
    with progress(console, "clips") as tell:
        tell(3, 8, "of [b]")
    assert "clips: of [b]" in text.getvalue() and "3/8" in text.getvalue()
