"""Programs side by side, one core each.

A job is a command, a log and a way to say how far it is: a training, an experiment, a measurement.
"""

import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

from fbid_gym.errors import InvalidValueError
from train.runs.interrupt import stop_requests

ONE_CORE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Environment of a program that is to use one core."""

_DEATH_SIGNAL = 1  # of prctl: the signal of a process whose parent is gone
_LIBC = ctypes.CDLL(None)
_POLL_SECONDS = 0.3
_LINE_SECONDS = 15.0
_LOG_LINES = 15


class Progress(NamedTuple):
    """Progress of a job."""

    share: float  # from 0 to 1
    note: str = ""  # its state or result, in words


@dataclass(frozen=True, eq=False)
class Job:
    """A program to run. On SIGINT it should save what it has and end."""

    name: str  # for people
    command: tuple[str, ...]  # the command line
    log: Path  # where its output goes
    # Says how far it is: asked before it starts, while it runs and once it has ended.
    progress: Callable[[], Progress]


class Running(Protocol):
    """A job that runs, here or elsewhere."""

    def poll(self) -> int | None:
        """Return its exit status; None while it runs."""

    def send_signal(self, number: int) -> None:
        """Send SIGINT."""

    def terminate(self) -> None:
        """End it."""


Start = Callable[[Job], Running]


def start_here(job: Job) -> Running:
    """Begin a job on this machine."""
    job.log.parent.mkdir(parents=True, exist_ok=True)
    with job.log.open("wb") as log:
        return subprocess.Popen(
            job.command,
            stdout=log,
            stderr=subprocess.STDOUT,
            env={**os.environ, **ONE_CORE},
            # Ctrl-C reaches this process alone, which passes it on once: at a second one a
            # training stops without saving.
            start_new_session=True,
            preexec_fn=_end_with_us,
        )


def _end_with_us() -> None:
    """Ask for a SIGINT once the process that began this one is gone, even by a kill."""
    if hasattr(_LIBC, "prctl"):
        _LIBC.prctl(_DEATH_SIGNAL, signal.SIGINT)


def last_lines(log: Path, count: int) -> list[str]:
    """Return the last lines of a log, as far as it is there and text."""
    return log.read_text(errors="replace").splitlines()[-count:] if log.is_file() else []


def run_jobs(
    jobs: Sequence[Job],
    at_once: int,
    console: Console,
    *,
    keep_going: bool = False,
    start: Start = start_here,
) -> list[Job]:
    """Run all jobs, `at_once` at a time in their order.

    On SIGINT, SIGTERM or SIGHUP no more are started, and those that run get a SIGINT and the time
    to end.

    Args:
        jobs: to run.
        at_once: how many at a time, at least one.
        console: shows how far they are, and how the log of a failed one ends.
        keep_going: run the others although one has failed; otherwise they are stopped.
        start: begins a job; by default on this machine.

    Returns:
        Those that did not run to their end with status 0, in their order.

    Raises:
        InvalidValueError: none at a time.
        KeyboardInterrupt: it was asked to stop, and all has ended.
    """
    if at_once < 1:
        raise InvalidValueError("jobs", at_once, "at least 1 at a time")
    waiting, finished = list(jobs), list[Job]()
    running: dict[Job, Running] = {}
    stopping = False
    with (
        _ended_at_last(running),
        _watching(jobs, console) as show,
        stop_requests(lambda: console.print("Stopping; once more to stop at once.")) as stop,
    ):
        while running or (waiting and not stopping):
            while waiting and len(running) < at_once and not stopping:
                job = waiting.pop(0)
                running[job] = start(job)
            time.sleep(_POLL_SECONDS)
            statuses = {job: process.poll() for job, process in running.items()}
            ended = {job: status for job, status in statuses.items() if status is not None}
            for job, status in ended.items():
                del running[job]
                if status == 0:
                    finished.append(job)
                elif not stopping:
                    console.print(f"{job.name} failed with status {status}; {job.log} ends:")
                    for line in last_lines(job.log, _LOG_LINES):
                        console.print(line, markup=False, highlight=False)
            show(list(running), finished)
            failed = any(ended.values()) and not keep_going
            if not stopping and (stop() or failed):
                stopping = True
                for process in running.values():
                    process.send_signal(signal.SIGINT)
        if stop():
            raise KeyboardInterrupt
    return [job for job in jobs if job not in finished]


@contextmanager
def _ended_at_last(running: dict[Job, Running]) -> Iterator[None]:
    """Leave no process behind, not even at a second Ctrl-C."""
    try:
        yield
    finally:
        for process in running.values():
            process.terminate()


_Show = Callable[[Sequence[Job], Sequence[Job]], None]


@contextmanager
def _watching(jobs: Sequence[Job], console: Console) -> Iterator[_Show]:
    """Yield a display of running and finished jobs: bars, or lines without a terminal."""
    if console.is_terminal:
        with _bars(jobs, console) as show:
            yield show
    else:
        yield _lines(len(jobs), console)


def _lines(total: int, console: Console) -> _Show:
    began = last = time.monotonic()
    told = 0

    def show(running: Sequence[Job], finished: Sequence[Job]) -> None:
        nonlocal last, told
        while told < len(finished):
            told += 1
            console.print(f"{finished[told - 1].name}: done, {told} of {total}", highlight=False)
        if time.monotonic() - last >= _LINE_SECONDS:
            last = time.monotonic()
            for job in running:
                share, note = job.progress()
                console.print(f"{job.name}: {share:.0%} {note}", markup=False, highlight=False)
            done = len(finished) + sum(job.progress().share for job in running)
            if done > 0:
                left = (last - began) * (total - done) / done / 60
                console.print(f"about {left:.1f} min left for all", highlight=False)

    return show


@contextmanager
def _bars(jobs: Sequence[Job], console: Console) -> Iterator[_Show]:
    columns = (
        *(TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %")),
        *(TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn()),
        TextColumn("{task.fields[note]}", markup=False),
    )
    with Bars(*columns, console=console) as bars:
        tasks = {job: bars.add_task(job.name, False, 1.0, note="") for job in jobs}
        everything = bars.add_task("all", total=float(len(jobs)), note="")

        full = set[Job]()

        def show(running: Sequence[Job], finished: Sequence[Job]) -> None:
            for job in (*running, *(job for job in finished if job not in full)):
                task = tasks[job]
                if not bars.tasks[task].started:
                    bars.start_task(task)
                share, note = job.progress()
                bars.update(task, completed=1.0 if job in finished else share, note=note)
            full.update(finished)
            bars.update(everything, completed=sum(bars.tasks[i].completed for i in tasks.values()))

        yield show
