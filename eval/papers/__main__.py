"""Run the papers' experiments and write one page: `make papers`, or `python -m eval.papers`.

Every experiment is a script of its own, run as a process of its own with one core; this starts
them, shows how far they are, and puts their sections together.
"""

import os
import shlex
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from eval.files import read_json, write
from eval.pages import PAPERS_PAGE, splice, spliced
from eval.papers.experiment import OUT, Experiment, load
from eval.papers.page import Paper, Section, page
from eval.papers.registry import PAPERS, experiments
from eval.papers.summary import summary
from fbid_gym.errors import FbidError, RunError

_POLL_SECONDS = 0.3
_LOG_LINES = 15


@dataclass(frozen=True)
class PapersConfig:
    """Run the papers' experiments and write one page."""

    only: tuple[str, ...] = ()
    """Names of scripts (fig4_slow_squat) or papers (mistry2010). Default: everything."""
    quick: bool = False
    """Fewer robots, shorter runs, coarser sweeps: to see that everything works."""
    out: Path = OUT
    """Folder of the data and of report.html."""
    jobs: int = field(default_factory=lambda: len(os.sched_getaffinity(0)))
    """Experiments at the same time, one core each."""
    page_only: bool = False
    """Put the page together from the sections that are there."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Put the papers' numbers beside ours into docs/papers.md."""


@dataclass(frozen=True, eq=False)
class _Job:
    """One experiment that is to be run."""

    experiment: Experiment
    config: PapersConfig

    @property
    def folder(self) -> Path:
        return self.experiment.folder(self.config.out)

    @property
    def log(self) -> Path:
        return self.folder / "log.txt"

    def start(self) -> "subprocess.Popen[bytes]":
        """Start its script."""
        self.folder.mkdir(parents=True, exist_ok=True)
        for stale in ("progress.json", "section.html"):
            (self.folder / stale).unlink(missing_ok=True)
        command = [sys.executable, "-m", self.experiment.module, "--out", str(self.config.out)]
        command += ["--quick"] if self.config.quick else []
        env = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        with self.log.open("wb") as log:
            return subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=env)

    def progress(self) -> tuple[float, str]:
        """Return the share that is done, and what is being done."""
        try:
            shown = read_json(self.folder / "progress.json")
        except (FileNotFoundError, RunError):  # not there yet
            return 0.0, ""
        return float(shown["share"]), str(shown["note"])

    def section(self) -> Section:
        """Return its section, or what there is to say when it has none."""
        experiment, body = self.experiment, self.folder / "section.html"
        name, command = experiment.name, experiment.command(self.config.quick)
        if not body.is_file():
            tail = self.log.read_text().splitlines()[-1:] if self.log.is_file() else ["not run"]
            return Section(
                name, experiment.title, experiment.about, (),
                f'<div class="callout warning">This did not run to the end: {tail}.</div>',
                command, 0.0, failed=True,
            )  # fmt: skip
        result, run = load(experiment, self.config.out)
        return Section(
            name, experiment.title, experiment.about, result.findings, body.read_text(),
            experiment.command(run["quick"]), run["seconds"],
        )  # fmt: skip


def run(jobs: Sequence[_Job], at_once: int, console: Console) -> bool:
    """Run all experiments, `at_once` at a time; return whether all ran to the end.

    A terminal shows bars; elsewhere each experiment that has ended is a line.
    """
    columns = (
        *(TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %")),
        TextColumn("{task.fields[note]}"),
    )
    waiting, running, whole = list(jobs), dict[_Job, subprocess.Popen[bytes]](), True
    with Progress(*columns, console=console, disable=not console.is_terminal) as bars:
        bar = {job: bars.add_task(job.experiment.name, total=1.0, note="") for job in jobs}
        try:
            while waiting or running:
                while waiting and len(running) < at_once:
                    job = waiting.pop(0)
                    running[job] = job.start()
                time.sleep(_POLL_SECONDS)
                for job, process in list(running.items()):
                    share, note = job.progress()
                    bars.update(bar[job], completed=share, note=note)
                    if process.poll() is not None:
                        del running[job]
                        bars.update(bar[job], completed=1.0, note="")
                        count = len(jobs) - len(waiting) - len(running)
                        whole &= _went_well(job, process, f"{count} of {len(jobs)}", console)
        finally:
            for process in running.values():
                process.terminate()
    return whole


def _went_well(job: _Job, process: "subprocess.Popen[bytes]", which: str, console: Console) -> bool:
    """Say that an experiment has ended, and how, if badly."""
    if process.returncode == 0:
        if not console.is_terminal:
            console.print(f"{job.experiment.name}: done, {which}")
        return True
    console.print(f"{job.experiment.name} failed; {job.log} ends:")
    for line in job.log.read_text().splitlines()[-_LOG_LINES:]:
        console.print(line, markup=False, highlight=False)
    return False


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line. An error of ours is one line and exit status 2."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    config = tyro.cli(PapersConfig, prog="python -m eval.papers", args=given, description=__doc__)
    console = Console()
    began = time.monotonic()
    try:
        chosen = experiments(PAPERS, config.only)
    except FbidError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if config.write_docs:
        spliced(PAPERS_PAGE, "")  # before minutes of experiments
    every = {entry: [_Job(e, config) for e in es] for entry, es in chosen.items()}
    jobs = [job for some in every.values() for job in some]
    whole = True
    if not config.page_only:
        # The longest first, so that all cores are busy to the end.
        order = sorted(jobs, key=lambda job: -job.experiment.minutes)
        whole = run(order, max(config.jobs, 1), console)
    papers = [
        Paper(entry.title, entry.about, [job.section() for job in some])
        for entry, some in every.items()
    ]
    seconds = time.monotonic() - began
    command = shlex.join(["python", "-m", "eval.papers", *given])
    report = config.out / "report.html"
    write(report, page(papers, command, seconds, config.quick))
    if config.write_docs:
        splice(PAPERS_PAGE, summary(papers))
    console.print(f"{seconds / 60:.1f} minutes. Page: {report}", highlight=False)
    return 0 if whole else 1


if __name__ == "__main__":
    sys.exit(main())
