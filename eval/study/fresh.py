"""What trained policies do in episodes that neither training nor its evaluations have seen.

The evaluations of a training are few episodes, the same every time: too few to count what befalls
one robot in a hundred.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from eval.files import check_folder, write
from eval.rollout import Player
from eval.study.cells import policy_digest
from eval.unseen import check_unseen
from fbid_gym.errors import RunError
from train.environments import make_envs
from train.evaluation import evaluate
from train.progress import Tell
from train.runs.reading import load
from train.runs.study import Cell, Study
from train.runs.tables import EVALUATIONS, read_rows, to_csv
from train.runs.training import is_finished
from train.runs.versions import versions

FIRST_SEED = 50_000
"""Robot i starts from it plus i: none that training, its evaluations or cards of policies use."""

_MEASURED = tuple(name for name in EVALUATIONS if name not in ("steps", "wall_seconds"))
_COLUMNS = ("run", "policy", "commit", *_MEASURED)

Columns = dict[str, np.ndarray]
"""Those of `evaluations.csv` that are of the episodes, (1,) each."""


@dataclass(frozen=True)
class Falls:
    """How many of the episodes of some runs together ended in a fall."""

    fallen: int
    episodes: int

    @classmethod
    def of(cls, played: Sequence[Columns]) -> "Falls":
        """Count those of runs, of as many episodes each."""
        fallen = sum((1.0 - its["survival"].item()) * its["episodes"].item() for its in played)
        return cls(round(fallen), round(sum(its["episodes"].item() for its in played)))

    def __str__(self) -> str:
        """Write it as "16 of 1,000"."""
        return f"{self.fallen:,} of {self.episodes:,}"


def fresh_file(study: Study) -> Path:
    """Return where it is kept: beside the runs, which studies may share."""
    return study.cells[0].config.folder.parent / "fresh_episodes.csv"


def measure(study: Study, episodes: int, tell: Tell) -> None:
    """Play the finished trainings of a study, as far as their policies have not been, and keep it.

    Args:
        study: what was trained.
        episodes: of every policy, one of each robot.
        tell: told how far it is.

    Raises:
        RunError: a policy that cannot be read, one that was evaluated from the same seeds, or what
            is kept is of another number of episodes; nothing is lost then.
        InvalidValueError: nothing can be written beside the runs.
    """
    file = fresh_file(study)
    check_folder(file.parent, "runs")
    rows = _rows(file)
    other = {int(float(row["episodes"])) for row in rows.values()} - {episodes}
    if other:
        raise RunError(
            f"{file}: is of {min(other)} episodes, not of {episodes}. Expected as many, or no such "
            "file: without it all is measured anew."
        )
    waiting = [cell for cell in _finished(study) if _of_today(rows, cell) is None]
    for cell in waiting:
        check_unseen(FIRST_SEED, episodes, cell.config.to_json(), cell.config.folder)
    played_with = _commit()
    for k, cell in enumerate(waiting):
        folder = cell.config.folder
        tell(k, len(waiting), folder.name)
        player = Player.of(load(folder))
        if cell.config.robots:  # it is played on all that it learnt with
            learnt_with = {"robots": list(cell.config.robots)}
            player = replace(player, env_args={**player.env_args, **learnt_with})
        envs = make_envs(player.env_id, player.make_args, episodes)
        try:
            actor = player.actor(envs.single_observation_space, envs.single_action_space)
            found = evaluate(actor, envs, FIRST_SEED)
        finally:
            envs.close()
        played = {"policy": policy_digest(folder), "commit": played_with}
        played |= {column: repr(found[column]) for column in _MEASURED}
        rows[folder.name] = {"run": folder.name} | played
        table = [{"commit": ""} | rows[name] for name in sorted(rows)]
        write(file, to_csv(_COLUMNS, table))


def kept(study: Study) -> tuple[dict[str, Columns], list[str]]:
    """Return what is kept of the finished trainings of a study.

    Returns:
        By the name of the run, of those whose policy is still the one that played; and warnings
        where others were measured, too, or by different states of the code.

    Raises:
        RunError: what is kept cannot be read.
    """
    rows = _rows(fresh_file(study))
    found, changed, commits = {}, [], set()
    for cell in _finished(study):
        name = cell.config.folder.name
        row = _of_today(rows, cell)
        if row is not None:
            found[name] = {column: np.array([float(row[column])]) for column in _MEASURED}
            commits.add(row.get("commit") or "unknown")
        elif name in rows:
            changed.append(name)
    warnings = []
    if changed:
        warnings.append(
            "Fresh episodes were played by policies that have changed since, of "
            f"{', '.join(changed)}, and are left out: --fresh-episodes plays them anew."
        )
    if len(commits) > 1:
        warnings.append(
            "Fresh episodes were played by different commits of this project: "
            f"{', '.join(sorted(commits))}."
        )
    return found, warnings


def _commit() -> str:
    """What state of this project plays."""
    known = versions()
    commit = str(known["commit"] or "unknown")[:12]
    return f"{commit} and changes" if known["uncommitted_changes"] else commit


def _finished(study: Study) -> list[Cell]:
    return [cell for cell in study.cells if is_finished(cell.config)]


def _of_today(rows: dict[str, dict[str, str]], cell: Cell) -> dict[str, str] | None:
    """Return the row of a training if its policy is still the one that was measured."""
    row = rows.get(cell.config.folder.name)
    if row is None or row["policy"] != policy_digest(cell.config.folder):
        return None
    return row


def _rows(file: Path) -> dict[str, dict[str, str]]:
    """Return what is kept, by the name of the run; nothing where there is no such file."""
    rows = read_rows(file)
    try:
        for row in rows:
            values = [float(row[column]) for column in _MEASURED]
            if any(map(math.isinf, values)) or not float(row["episodes"]) >= 1.0:
                raise ValueError("a number that is none")
        return {row["run"]: row for row in rows if row["policy"]}
    except (KeyError, TypeError, ValueError) as error:
        raise RunError(f"{file}: not the table of eval.study, or corrupt ({error}).") from error
