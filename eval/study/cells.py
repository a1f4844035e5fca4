"""The cells of a study as they stand on the disk, arm by arm."""

import hashlib
import json
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from eval.robustness.curves import digest
from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy
from train.runs.archive import found
from train.runs.config import TrainConfig
from train.runs.folder import RunFolder
from train.runs.reading import read_columns
from train.runs.study import Arm, Cell, Study, environment_name
from train.runs.tables import read_rows


class SeedCurves(NamedTuple):
    """One measure of an arm, at the evaluations that all seeds that count have had."""

    steps: np.ndarray  # (K,) of the training
    values: np.ndarray  # (S, K), a row for each seed


def curve(arm: Arm, column: str) -> SeedCurves:
    """Return a column of the evaluations, over steps and seeds; NaN where it is not known.

    "fallen" counts falls in training until then. The finished cells count; where there is none, all
    do, as far as they have come together.
    """
    cells = arm.finished() or arm.cells
    files = [RunFolder.of(cell.config.folder).evaluations for cell in cells]
    tables = [
        table | {"fallen": fallen(file.parent, table["steps"])}
        for file in files
        if (table := read_columns(file))
    ]
    # a training that goes on beyond what it was to take was evaluated once more there.
    common = [set(table["steps"].tolist()) for table in tables]
    steps = np.array(sorted(set.intersection(*common)) if common else [])
    values = [
        table.get(column, np.full(len(table["steps"]), np.nan))[np.isin(table["steps"], steps)]
        for table in tables
    ]
    return SeedCurves(steps, np.array(values).reshape(len(tables), len(steps)))


def exploring(run: TrainConfig) -> tuple[list[float], list[float]]:
    """Return steps and the mean return of the latest episodes of training, noise included."""
    rows = [
        (float(row["steps"]), float(row["return_mean"]))
        for row in read_rows(RunFolder.of(run.folder).progress)
    ]
    known = [(step, mean) for step, mean in rows if math.isfinite(mean)]
    return [step for step, _ in known], [mean for _, mean in known]


def fallen(folder: Path, steps: np.ndarray) -> np.ndarray:
    """Return how often robots had fallen in training by these steps; NaN where it is not known."""
    rows = read_rows(RunFolder.of(folder).progress)
    if not rows or not all(row.get("falls") for row in rows):
        return np.full(len(steps), np.nan)
    known = [(0.0, 0.0), *((float(row["steps"]), float(row["falls"])) for row in rows)]
    return np.interp(steps, *np.array(known).T)


def policy_digest(cell: Cell) -> str:
    """Return the digest of the policy of a cell; empty where there is none that can be read.

    Of a policy that learns nothing it is that of all that a study says of it.
    """
    run = cell.config
    if cell.policy:
        its = (run.env, run.make_args(), run.robot, run.feet, run.eval.seed, run.eval.episodes)
        return hashlib.sha256(json.dumps([cell.policy, *its], sort_keys=True).encode()).hexdigest()
    try:
        return digest(Policy.load(found(run.folder)))
    except FbidError:
        return ""


def robustness_file(study: Study, env_id: str) -> Path:
    """Return where the robustness of a study's policies in an environment is kept."""
    # Studies may share a folder, and with it the trainings that they have in common.
    return study.runs / "robustness" / f"{study.name}-{environment_name(env_id)}.json"
