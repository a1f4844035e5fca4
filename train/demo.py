"""Train two action layers with two seeds each, compare them, leave a report: `make demo`.

Every training is a `python -m train.ppo` of its own with its folder under `runs/demo`, one core
each. Interrupted, the same command continues where they were.
"""

import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from eval.compare import main as compare
from train.config import cores
from train.interrupt import StopRequest

_POLL_SECONDS = 0.5
_LINE_SECONDS = 15.0
_LOG_LINES = 15


@dataclass(frozen=True)
class DemoConfig:
    """Train two action layers with two seeds each, compare them, leave a report."""

    out: Path = Path("runs/demo")
    """Folder of the runs and of report.html."""
    env: str = "fbid_gym/BipedBalance-v0"
    """Environment id."""
    layers: tuple[str, ...] = ("base_acceleration", "joint_position")
    """Action layers. The slowest first keeps all cores busy to the end."""
    seeds: tuple[int, ...] = (0, 1)
    """Seeds of each layer."""
    total_steps: int = 120_000
    """Environment steps of each run."""
    evaluations: int = 6
    """Evaluations of each run, evenly spread."""
    episodes: int = 16
    """Episodes of each evaluation."""
    jobs: int = field(default_factory=lambda: cores())
    """Runs at the same time, one core each."""


@dataclass(frozen=True)
class _Job:
    """One run of the demo."""

    layer: str
    seed: int
    folder: Path
    log: Path
    command: tuple[str, ...]

    @property
    def name(self) -> str:
        return f"{self.layer}, seed {self.seed}"

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


def jobs(config: DemoConfig) -> list[_Job]:
    """Return the runs in the order in which they are started."""
    found = []
    for layer in config.layers:
        for seed in config.seeds:
            folder = config.out / f"{layer}-s{seed}"
            command = (
                *(sys.executable, "-m", "train.ppo"),
                *("--env", config.env, "--action-layer", layer, "--seed", str(seed)),
                *("--total-steps", str(config.total_steps), "--out", str(folder)),
                *("--num-threads", "1"),
                *("--eval.every", str(max(config.total_steps // config.evaluations, 1))),
                *("--eval.episodes", str(config.episodes)),
            )
            found.append(
                _Job(layer, seed, folder, config.out / "logs" / f"{folder.name}.log", command)
            )
    return found


def train(config: DemoConfig, console: Console) -> bool:
    """Run all trainings, `config.jobs` at a time, and return whether all finished.

    On SIGINT or SIGTERM, or when one fails, the others are asked to stop, which saves them.
    """
    every = jobs(config)
    waiting, running = list(every), dict[_Job, subprocess.Popen[bytes]]()
    (config.out / "logs").mkdir(parents=True, exist_ok=True)
    stopping = False
    with (
        _watching(every, config.total_steps, console) as show,
        StopRequest(lambda: console.print("Stopping; the same command continues.")) as stop,
    ):
        while running or (waiting and not stopping):
            while waiting and len(running) < config.jobs and not stopping:
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


def _start(job: _Job) -> subprocess.Popen[bytes]:
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
def _watching(every: Sequence[_Job], total: int, console: Console) -> Iterator[Callable[[], None]]:
    """Yield what shows how far the runs are: bars, or lines where there is no terminal."""
    if not console.is_terminal:
        last = time.monotonic()

        def lines() -> None:
            nonlocal last
            if time.monotonic() - last >= _LINE_SECONDS:
                last = time.monotonic()
                for job in every:
                    if 0 < job.steps < total:
                        console.print(f"{job.name}: {job.steps} of {total} steps{job.result}")

        yield lines
        return
    columns = (
        *(TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %")),
        *(TimeElapsedColumn(), TextColumn("{task.fields[result]}")),
    )
    with Progress(*columns, console=console) as progress:
        tasks = {job: progress.add_task(job.name, False, total, result="") for job in every}

        def bars() -> None:
            for job, task in tasks.items():
                if job.steps and not progress.tasks[task].started:
                    progress.start_task(task)
                progress.update(task, completed=min(job.steps, total), result=job.result)

        yield bars


def table(every: Sequence[_Job]) -> Table:
    """Return what the runs came to."""
    names = ("layer", "seed", "before", "after", "best", "survival", "minutes")
    found = Table(*names, title="Return at evaluation")
    for job in every:
        rows = job.rows("evaluations.csv")
        first, last = rows[0], rows[-1]
        best = max(float(row["return_mean"]) for row in rows)
        found.add_row(
            job.layer,
            str(job.seed),
            f"{float(first['return_mean']):.0f}",
            f"{float(last['return_mean']):.0f}",
            f"{best:.0f}",
            f"{float(last['survival']):.0%}",
            f"{float(last['wall_seconds']) / 60:.1f}",
        )
    return found


def main(config: DemoConfig) -> int:
    """Train, compare, report; return the exit status."""
    console = Console()
    began = time.monotonic()
    if not train(config, console):
        return 1
    every = jobs(config)
    report = config.out / "report.html"
    status = compare([*(str(job.folder) for job in every), "--out", str(report)])
    if status != 0:
        return status
    console.print(table(every))
    console.print(f"{(time.monotonic() - began) / 60:.1f} minutes. Report: {report}")
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(DemoConfig, prog="python -m train.demo")))
