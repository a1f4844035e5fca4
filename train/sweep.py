"""Run every training of a study: `python -m train.sweep studies/survey.toml`.

Each is a `python -m train.ppo` of its own, one core each. Finished trainings are left alone and
begun ones continue, so the same command goes on after any interruption. `--ray` runs
them on the machines of a cluster, in the same folders (`train.runs.cluster`).
"""

import sys
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table

from fbid_gym.options import Whole
from train.command import run_command
from train.runs.cluster import cluster
from train.runs.config import cores
from train.runs.endpoints import register
from train.runs.files import check_folder
from train.runs.jobs import Job, Start, run_jobs, start_here
from train.runs.study import Cell, Study, check_cells, read_study
from train.runs.training import is_finished, last_line, training_job
from train.runs.training import standing as state_of


@dataclass(frozen=True)
class SweepConfig:
    """Run the unfinished trainings of a study, and show its state."""

    study: tyro.conf.Positional[Path]
    """TOML file, see `train.runs.study`."""
    out: Path | None = None
    """Folder of the runs; by default the one that the study names, or runs/NAME."""
    workers: Annotated[int, Whole(1, 1024)] | None = None
    """Trainings at the same time, one core each. Default: as many as there are cores."""
    ray: str | None = None
    """Train on a Ray cluster: the address of its head, or "auto" for that of this machine."""
    dry_run: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Show where the study stands, and run nothing."""


def standing(study: Study, failed: frozenset[str] = frozenset()) -> Table:
    """Return where each cell of a study is; of those that have just `failed` with a reason."""
    table = Table("training", "state", "so far", title=study.title)
    for cell in study.cells:
        state, note = state_of(cell.config)
        if cell.name in failed:
            state, note = "failed", last_line(cell.config) or "no word of why"
        table.add_row(cell.name, state, note)
    return table


def unfinished(study: Study) -> list[Cell]:
    """Return the cells that have steps left to train."""
    return [cell for cell in study.cells if not is_finished(cell.config)]


def main(config: SweepConfig) -> int:
    """Train; return the exit status."""
    console, study = Console(), read_study(config.study, config.out)
    check_cells(study)
    not_done, failed = list[Job](), frozenset[str]()
    if not config.dry_run:
        check_folder(study.runs, "out")
        register(study.name, study.runs, study.endpoints)
        jobs = [training_job(cell.name, cell.config) for cell in unfinished(study)]
        with _machines(config.ray, study.runs) as (start, most):
            at_once = config.workers or most
            try:
                not_done = run_jobs(jobs, at_once, console, keep_going=True, start=start)
            except KeyboardInterrupt:
                console.print(standing(study))
                raise
        failed = frozenset(job.name for job in not_done if job.log.exists())
    console.print(standing(study, failed))
    return 1 if not_done else 0


def _machines(address: str | None, folder: Path) -> AbstractContextManager[tuple[Start, int]]:
    """Return the function that starts jobs, and the number of cores: here, or on a cluster."""
    return nullcontext((start_here, cores())) if address is None else cluster(address, folder)


if __name__ == "__main__":
    sys.exit(run_command("train.sweep", SweepConfig, main))
