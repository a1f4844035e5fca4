"""What a study came to: its learning curves and a table, `python -m eval.study STUDY.toml`.

`train.sweep` trains what a study names; this reads the run folders. A cell that has not finished
counts with what it has, and is said to be unfinished.
"""

import math
import sys
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import tyro
from rich.console import Console

from eval.files import write
from eval.pages import DOCS, splice, spliced
from eval.plots import Series, panel, sheet
from eval.wording import number, percent
from eval.wording import steps as steps_text
from fbid_gym.errors import RunError
from train.runs.config import TrainConfig
from train.runs.exit_status import exit_status
from train.runs.folder import RunFolder
from train.runs.study import Cell, Study, environment_name, read_study
from train.runs.tables import read_rows, to_csv
from train.runs.training import progress

_COLUMNS = ("env", "arm", "seed", "steps", "wall_seconds", "episodes", "return_mean", "return_q25",
            "return_q75", "survival", "velocity_error", "return_exploring")  # fmt: skip
_MEASURES = {"return_mean": "return", "velocity_error": "velocity error, m/s"}
"""Column of the evaluations -> what its panels are called."""


@dataclass(frozen=True)
class StudyConfig:
    """Print the table of a study; draw its learning curves."""

    study: tyro.conf.Positional[Path]
    """TOML file, see `train.runs.study`."""
    out: Path | None = None
    """Folder of the runs; by default `runs` and the study's name."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Write the curves and the table to docs: NAME.svg, NAME.csv and, between its marks, NAME.md,
    after the study's name."""


class Arm(NamedTuple):
    """The cells of a study that differ in their seed alone."""

    env: str
    name: str
    cells: tuple[Cell, ...]


class Curve(NamedTuple):
    """One measure of an arm, at the evaluations that all its seeds have had.

    Attributes:
        steps: (K,) of the training.
        values: (S, K), a row for each seed.
    """

    steps: np.ndarray
    values: np.ndarray


def arms(study: Study) -> list[Arm]:
    """Return the arms of a study in the order of its file."""
    found: dict[tuple[str, str], list[Cell]] = {}
    for cell in study.cells:
        found.setdefault((cell.config.env, cell.arm), []).append(cell)
    return [Arm(env, name, tuple(cells)) for (env, name), cells in found.items()]


def evaluations(run: TrainConfig) -> list[dict[str, str]]:
    """Return the rows of a run's evaluations."""
    return read_rows(RunFolder.of(run.folder).evaluations)


def curve(arm: Arm, column: str) -> Curve:
    """Return a column of the evaluations, over steps and seeds."""
    tables = [rows for cell in arm.cells if (rows := evaluations(cell.config))]
    common = min(map(len, tables), default=0)
    steps = [float(row["steps"]) for row in tables[0][:common]] if tables else []
    values = [[float(row[column]) for row in rows[:common]] for rows in tables]
    return Curve(np.array(steps), np.array(values).reshape(len(tables), common))


def exploring(run: TrainConfig) -> tuple[list[float], list[float]]:
    """Return steps and the mean return of the latest episodes of training, noise included."""
    rows = [
        (float(row["steps"]), float(row["return_mean"]))
        for row in read_rows(RunFolder.of(run.folder).progress)
    ]
    known = [(step, mean) for step, mean in rows if math.isfinite(mean)]
    return [step for step, _ in known], [mean for _, mean in known]


def numbers(study: Study) -> str:
    """Return the evaluations of all cells as CSV, with the return of training at that time."""
    rows = []
    for cell in study.cells:
        run = cell.config
        trained, means = exploring(run)
        known = {"env": run.env, "arm": cell.arm, "seed": run.seed}
        for row in evaluations(run):
            until = bisect_right(trained, float(row["steps"]))
            rows.append({**known, **row, "return_exploring": means[until - 1] if until else ""})
    return to_csv(_COLUMNS, rows)


def drawn(study: Study) -> str:
    """Return the learning curves as SVG: a panel for each environment and measure.

    Thick: the mean over seeds of the policy without noise, its band from the worst seed to the
    best. Thin, beside returns: with the noise of exploration, which is what PPO climbs.
    """
    by_env: dict[str, list[Arm]] = {}
    for arm in arms(study):
        by_env.setdefault(arm.env, []).append(arm)
    panels = []
    for env, its in by_env.items():
        for column, title in _MEASURES.items():
            series = [item for k, arm in enumerate(its) for item in _series(arm, column, k)]
            if series:
                what = f"{title}, {environment_name(env)}"
                panels.append(panel(series, what, "steps", x_format=steps_text))
    if not panels:
        raise RunError(f"Study {study.name!r} has not been evaluated yet: python -m train.sweep.")
    return sheet(panels)


def _series(arm: Arm, column: str, colour: int) -> Iterator[Series]:
    steps, values = curve(arm, column)
    if not np.isfinite(values).any():
        return
    several = len(values) > 1
    thin = [exploring(cell.config) for cell in arm.cells] if column == "return_mean" else []
    yield Series(
        arm.name,
        colour,
        steps.tolist(),
        values.mean(axis=0).tolist(),
        values.min(axis=0).tolist() if several else None,
        values.max(axis=0).tolist() if several else None,
        singles=tuple(single for single in thin if single[0]),
        dots=True,
    )


_HEAD = ("Environment", "Arm", "Seeds", "Steps", "Velocity error (m/s)", "Survival", "Return")


def table(study: Study) -> str:
    """Return what the arms came to, as Markdown: before -> after, (worst to best seed)."""
    lines = [f"| {' | '.join(_HEAD)} |", f"|{' --- |' * len(_HEAD)}"]
    for arm in arms(study):
        errors, survival, returns = (
            curve(arm, name) for name in ("velocity_error", "survival", "return_mean")
        )
        finished = sum(progress(cell.config).share >= 1.0 for cell in arm.cells)
        seeds = str(len(arm.cells))
        if finished < len(arm.cells):
            seeds = f"{finished} of {seeds} finished"
        steps = steps_text(errors.steps[-1]) if len(errors.steps) else "none"
        cells = [environment_name(arm.env), arm.name, seeds, steps]
        cells += [_change(errors.values, _fine), _change(survival.values, percent)]
        cells += [_change(returns.values, number)]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _fine(value: float) -> str:
    return f"{value:.3f}"


def _change(values: np.ndarray, form: Callable[[float], str]) -> str:
    """Write the mean over seeds before and after, and the range of the latter."""
    if not values.size or not np.isfinite(values).any():
        return "–"
    last = values[:, -1]
    text = f"{form(values[:, 0].mean())} → {form(last.mean())}"
    spread = f" ({form(last.min())} to {form(last.max())})" if len(values) > 1 else ""
    return text + spread


def main(config: StudyConfig) -> int:
    """Read, print, write; return the exit status."""
    study = read_study(config.study, config.out)
    found = table(study)
    page = DOCS / f"{study.name}.md"
    if config.write_docs:
        spliced(page, found)  # refuses before anything is written
        write(page.with_suffix(".csv"), numbers(study))
        write(page.with_suffix(".svg"), drawn(study))
        splice(page, found)
    Console(width=200, highlight=False).print(found, markup=False)
    return 0


if __name__ == "__main__":
    chosen = tyro.cli(StudyConfig, prog="python -m eval.study")
    sys.exit(exit_status(lambda: main(chosen)))
