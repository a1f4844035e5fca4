"""Progress of a long command: a bar with the time left, or lines without a terminal."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

Tell = Callable[[int, int, str], None]
"""Told how many are done, of how many, and what is next."""


@contextmanager
def progress(console: Console, what: str, every: float = 60.0, start: int = 0) -> Iterator[Tell]:
    """Yield what shows how far something is.

    Args:
        console: where.
        what: is counted.
        every: s between lines, where there is no terminal.
        start: what had been done before, and took none of the time.
    """
    if not console.is_terminal:
        yield _lines(console, what, every, start)
        return
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
    with Progress(*columns, TimeRemainingColumn(), console=console, transient=True) as bars:
        task = bars.add_task(escape(what), total=None)

        def tell(done: int, total: int, doing: str) -> None:
            named = escape(f"{what}: {doing}" if doing else what)
            bars.update(task, completed=done, total=total, description=named)

        yield tell


def _lines(console: Console, what: str, every: float, start: int) -> Tell:
    began = last = time.monotonic()

    def tell(done: int, total: int, doing: str) -> None:
        nonlocal last
        now = time.monotonic()
        if done <= start or now - last < every:
            return
        last, left = now, (now - began) * max(total - done, 0) / (done - start) / 60.0
        now_at = f", {doing}" if doing else ""
        say(console, f"{what}: {done:,} of {total:,}{now_at}; about {left:.1f} min left")

    return tell


def say(console: Console, line: str) -> None:
    """Print a line as it is, above a bar if there is one."""
    if console.is_terminal:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    else:  # where nobody reads any more, rich would end the process
        print(line, file=console.file, flush=True)
