"""Run one experiment in this process: `python -m eval.papers.script fig4_slow_squat`.

`eval.papers` starts one of these for each experiment that it shows.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from eval.papers.experiment import OUT, perform
from eval.papers.registry import PAPERS, experiments
from train.command import run_command


@dataclass(frozen=True)
class ScriptConfig:
    """Run experiments one after another, save their numbers and their sections."""

    names: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Of experiments or papers."""
    quick: bool = False
    """Fewer robots, shorter runs, coarser sweeps."""
    out: Path = OUT
    """Folder of the papers' experiments."""


def run(config: ScriptConfig) -> None:
    """Do so, and print what was found."""
    for experiment in (e for _, some in experiments(PAPERS, config.names) for e in some):
        saved = perform(experiment, config.out, config.quick)
        for finding in saved.findings:
            print(f"{finding.what}: {finding.ours} (paper: {finding.paper})")
        print(f"{saved.seconds:.0f} s. Section: {experiment.folder(config.out) / 'section.html'}")


if __name__ == "__main__":
    sys.exit(run_command("eval.papers.script", ScriptConfig, run, about=__doc__))
