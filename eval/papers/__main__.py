"""Run the papers' experiments and write one page: `make papers`, or `python -m eval.papers`.

Every experiment is a process of its own with one core; this starts them, shows how far they are,
and puts their sections together.
"""

import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from eval.page.docs import PAPERS_PAGE, splice, spliced
from eval.papers.experiment import OUT, Experiment, load, perform
from eval.papers.page import ExperimentSection, page, summary
from eval.papers.registry import experiments
from fbid_gym.errors import RunError
from fbid_gym.options import Whole
from train.command import run_command
from train.runs.config import cores
from train.runs.files import check_folder, read_json, write
from train.runs.jobs import Job, Progress, run_jobs

_LOG = "log.txt"


@dataclass(frozen=True)
class PapersConfig:
    """Run the papers' experiments and write one page."""

    only: tuple[str, ...] = ()
    """Names of experiments (fig4_slow_squat) or papers (mistry2010). Default: everything."""
    quick: bool = False
    """Fewer robots, shorter runs, coarser sweeps: to see that everything works."""
    out: Path = OUT
    """Folder of the data and of report.html."""
    jobs: Annotated[int, Whole(1, 1024)] = field(default_factory=cores)
    """Experiments at the same time, one core each."""
    alone: bool = False
    """Run in this process, print what was found and write no page."""
    page_only: bool = False
    """Put the page together from the sections that are there."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Put the papers' numbers beside ours into docs/papers.md."""


def _job(experiment: Experiment, config: PapersConfig) -> Job:
    """It alone as a job."""
    folder = experiment.folder(config.out)

    def progress() -> Progress:
        try:
            return Progress(**read_json(folder / "progress.json"))
        except (TypeError, RunError):  # not there yet
            return Progress(0.0)

    command = (sys.executable, "-m", "eval.papers", "--alone", "--only", experiment.name)
    options = ("--out", str(config.out), *(("--quick",) if config.quick else ()))
    return Job(experiment.name, command + options, folder / _LOG, progress)


def _section(experiment: Experiment, config: PapersConfig) -> ExperimentSection:
    """Its section, or what there is to say when it has none."""
    saved, log = load(experiment, config.out), experiment.folder(config.out) / _LOG
    if saved is not None:
        return ExperimentSection(experiment, *saved, experiment.command(saved[0].quick))
    tail = log.read_text().splitlines()[-1:] if log.is_file() else ["not run"]
    wrong = f"This did not run to the end: {tail}."
    return ExperimentSection(experiment, None, wrong, experiment.command(config.quick))


def run(config: PapersConfig, command: Sequence[str]) -> int:
    """Run, put the page together, write; what can be refused is refused before."""
    check_folder(config.out, "out")
    chosen, console = experiments(config.only), Console()
    # The longest first, so that all cores are busy to the end.
    order = sorted((e for _, some in chosen for e in some), key=lambda one: -one.minutes)
    if config.alone:
        for finding in (f for e in order for f in perform(e, config.out, config.quick).findings):
            print(f"{finding.what}: {finding.ours} (paper: {finding.paper})")
        return 0
    began = time.monotonic()
    if config.write_docs:
        spliced(PAPERS_PAGE, "")  # before minutes of experiments
    failed: list[Job] = []
    if not config.page_only:
        for experiment, stale in product(order, ("progress.json", "section.html")):
            (experiment.folder(config.out) / stale).unlink(missing_ok=True)
        jobs = [_job(experiment, config) for experiment in order]
        failed = run_jobs(jobs, config.jobs, console, keep_going=True)
    papers = [
        (paper, [_section(experiment, config) for experiment in some]) for paper, some in chosen
    ]
    seconds = time.monotonic() - began
    report = config.out / "report.html"
    write(report, page(papers, shlex.join(command), seconds, config.quick))
    if config.write_docs:
        splice(PAPERS_PAGE, summary(papers))
    console.print(f"{seconds / 60:.1f} minutes. Page: {report}", markup=False, highlight=False)
    return 1 if failed else 0


main = partial(run_command, "eval.papers", PapersConfig, run, about=__doc__, told=True)


if __name__ == "__main__":
    sys.exit(main())
