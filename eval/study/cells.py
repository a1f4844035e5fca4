"""The cells of a study as they stand on the disk, arm by arm."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from eval.robustness.curves import digest
from fbid_gym.errors import FbidError, RunError
from fbid_gym.policy import Policy
from train.runs.config import TrainConfig
from train.runs.differences import in_words, run_differences
from train.runs.files import read_json
from train.runs.folder import RunFolder
from train.runs.robots import chosen, with_robot
from train.runs.study import Cell, Study, environment_name
from train.runs.tables import read_rows
from train.runs.training import is_finished


class Arm(NamedTuple):
    """The cells of a study that differ in their seed alone."""

    env: str
    name: str
    cells: tuple[Cell, ...]


class Curve(NamedTuple):
    """One measure of an arm, at the evaluations that all seeds that count have had.

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


def check_cells(study: Study) -> None:
    """Check that the run folders are those of the study.

    Raises:
        RunError: one is of another training than the study says, or of a longer one.
    """
    for cell in study.cells:
        folder = RunFolder.of(cell.config.folder)
        if not folder.config.is_file():
            continue
        stored, run = read_json(folder.config), cell.config
        robot = chosen(run.robot, run.feet)
        asked = (run if robot is None else with_robot(run, robot)).to_json()
        different = in_words(run_differences(stored, asked))
        trains, wants = stored.get("total_steps"), asked["total_steps"]
        if not different and isinstance(trains, int) and trains > wants:
            different = f"total_steps {wants} instead of {trains}"
        if different:
            raise RunError(
                f"{folder.path}: is not what the study says: it says {different}. Expected the "
                "folder of its own runs, see --runs."
            )


def evaluations(run: TrainConfig) -> list[dict[str, str]]:
    """Return the rows of a run's evaluations."""
    return read_rows(RunFolder.of(run.folder).evaluations)


def columns(run: TrainConfig) -> dict[str, np.ndarray]:
    """Return the evaluations of a run by column, (K,) each; empty where there are none.

    Raises:
        RunError: a value that is no number, or steps that do not increase.
    """
    path, rows = RunFolder.of(run.folder).evaluations, evaluations(run)
    if not rows:
        return {}
    try:
        found = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    except (TypeError, ValueError) as error:
        raise RunError(f"{path}: holds more than numbers ({error}).") from error
    if "steps" not in found or (np.diff(found["steps"]) <= 0).any():
        raise RunError(f"{path}: the steps do not increase from row to row.")
    return found


def curve(arm: Arm, column: str) -> Curve:
    """Return a column of the evaluations, over steps and seeds.

    The finished cells count; where there is none, all do, as far as they have come together.
    """
    cells = [cell for cell in arm.cells if is_finished(cell.config)] or arm.cells
    tables = [rows for cell in cells if (rows := evaluations(cell.config))]
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


def policy_digest(folder: Path) -> str:
    """Return the digest of a run's policy; empty where there is none that can be read."""
    try:
        return digest(Policy.load(folder))
    except FbidError:
        return ""


def robustness_file(study: Study, env_id: str) -> Path:
    """Return where the robustness of a study's policies in an environment is kept."""
    runs = study.cells[0].config.folder.parent
    # Studies may share a folder, and with it the trainings that they have in common.
    return runs / "robustness" / f"{study.name}-{environment_name(env_id)}.json"
