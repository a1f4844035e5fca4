"""Trainings side by side, each a `python -m train.ppo` of its own, one core each."""

import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from train.interrupt import StopRequest

_POLL_SECONDS = 0.5
_LINE_SECONDS = 15.0
_LOG_LINES = 15


@dataclass(frozen=True)
class Job:
    """One training.

    Attributes:
        name: for people.
        folder: of the run.
        log: where its output goes.
        total_steps: environment steps.
        options: of `train.ppo`, beside the folder and the steps.
    """

    name: str
    folder: Path
    log: Path
    total_steps: int
    options: tuple[str, ...]

    @property
    def command(self) -> tuple[str, ...]:
        """The command line."""
        return (
            *(sys.executable, "-m", "train.ppo", *self.options),
            *("--total-steps", str(self.total_steps), "--out", str(self.folder)),
            *("--num-threads", "1"),
        )

    @property
    def steps(self) -> int:
        """Steps trained so far."""
        rows = self.rows("progress.csv")
        return int(rows[-1]["steps"]) if rows else 0

    @property
    def result(self) -> str:
        """The latest evaluation, in words."""
        rows = self.rows("evaluations.csv")
        if not rows:
            return ""
        latest, survival = float(rows[-1]["return_mean"]), float(rows[-1]["survival"])
        return f"  return {latest:.0f}, survival {survival:.0%}"

    def rows(self, file: str) -> list[dict[str, str]]:
        """Read a CSV of the run; empty before it is there."""
        path = self.folder / file
        if not path.exists():
            return []
        text = path.read_text()
        # the last line may just be being written
        return list(csv.DictReader(text[: text.rfind("\n") + 1].splitlines()))


def train(every: Sequence[Job], at_once: int, console: Console) -> bool:
    """Run all trainings, `at_once` at a time in their order, and return whether all finished.

    On SIGINT or SIGTERM, or when one fails, the others are asked to stop, which saves them.
    """
    waiting, running = list(every), dict[Job, subprocess.Popen[bytes]]()
    for job in every:
        job.log.parent.mkdir(parents=True, exist_ok=True)
    stopping = False
    with (
        _watching(every, console) as show,
        StopRequest(lambda: console.print("Stopping; the same command continues.")) as stop,
    ):
        while running or (waiting and not stopping):
            while waiting and len(running) < at_once and not stopping:
                job = waiting.pop(0)
                running[job] = _start(job)
            time.sleep(_POLL_SECONDS)
            show()
            ended = {job: p.returncode for job, p in running.items() if p.poll() is not None}
            for job, status in ended.items():
                del running[job]
                if status != 0 and not stopping:
                    console.print(f"{job.name} failed with status {status}; {job.log} ends:")
                    for line in job.log.read_text().splitlines()[-_LOG_LINES:]:
                        console.print(line, markup=False, highlight=False)
            if not stopping and (stop.requested or any(ended.values())):
                stopping = True
                for process in running.values():
                    process.send_signal(signal.SIGINT)
    return not stopping


def _start(job: Job) -> subprocess.Popen[bytes]:
    with job.log.open("wb") as log:
        return subprocess.Popen(
            job.command,
            stdout=log,
            stderr=subprocess.STDOUT,
            env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            # Ctrl-C reaches this process alone, which passes it on once: at a second one a
            # training stops without saving.
            start_new_session=True,
        )


@contextmanager
def _watching(every: Sequence[Job], console: Console) -> Iterator[Callable[[], None]]:
    """Yield what shows how far the runs are: bars, or lines where there is no terminal."""
    if not console.is_terminal:
        last = time.monotonic()

        def lines() -> None:
            nonlocal last
            if time.monotonic() - last >= _LINE_SECONDS:
                last = time.monotonic()
                for job in every:
                    if 0 < job.steps < job.total_steps:
                        done = f"{job.steps} of {job.total_steps} steps"
                        console.print(f"{job.name}: {done}{job.result}")

        yield lines
        return
    columns = (
        *(TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %")),
        *(TimeElapsedColumn(), TextColumn("{task.fields[result]}")),
    )
    with Progress(*columns, console=console) as progress:
        tasks = {
            job: progress.add_task(job.name, False, job.total_steps, result="") for job in every
        }

        def bars() -> None:
            for job, task in tasks.items():
                if job.steps and not progress.tasks[task].started:
                    progress.start_task(task)
                progress.update(task, completed=min(job.steps, job.total_steps), result=job.result)

        yield bars
