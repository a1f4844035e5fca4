"""How far a long command is: a bar with the time left, or a line a minute without a terminal."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

Tell = Callable[[int, int, str], None]
"""Told how many are done, of how many, and what is next."""

_LINE_SECONDS = 60.0


@contextmanager
def progress(console: Console, what: str) -> Iterator[Tell]:
    """Yield what shows how far something is; `what` says what is counted."""
    if not console.is_terminal:
        yield _lines(console, what)
        return
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
    with Progress(*columns, TimeRemainingColumn(), console=console, transient=True) as bars:
        task = bars.add_task(escape(what), total=None)

        def tell(done: int, total: int, doing: str) -> None:
            named = escape(f"{what}: {doing}" if doing else what)
            bars.update(task, completed=done, total=total, description=named)

        yield tell


def _lines(console: Console, what: str) -> Tell:
    began = last = time.monotonic()

    def tell(done: int, total: int, doing: str) -> None:
        nonlocal last
        now = time.monotonic()
        if done == 0 or now - last < _LINE_SECONDS:
            return
        last, left = now, (now - began) * (total - done) / done / 60.0
        now_at = f", {doing}" if doing else ""
        line = f"{what}: {done:,} of {total:,}{now_at}; about {left:.1f} min left"
        console.print(line, markup=False, highlight=False, soft_wrap=True)

    return tell
