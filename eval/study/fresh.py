"""Play policies in episodes that neither training nor its evaluations have seen.

The evaluations of a training are few episodes, the same every time: too few to count what befalls
one robot in a hundred. A policy that learns nothing plays those, too, so that the curves of the
trainings can be set against it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from eval.comparable import check_unseen
from eval.robustness.arms import environment
from eval.rollout import Player, play_player
from eval.study.cells import policy_digest
from fbid_gym.errors import RunError
from train.evaluation import summary
from train.progress import Tell
from train.runs.files import check_folder, write
from train.runs.study import Cell, Study, arms
from train.runs.tables import EVALUATIONS, read_rows, to_csv
from train.runs.versions import versions

FIRST_SEED = 50_000
"""Robot i starts from it plus i: none that training, its evaluations or cards of policies use."""

_MEASURED = tuple(name for name in EVALUATIONS if name not in ("steps", "wall_seconds"))
_EACH = {"return_mean": "returned", "survival": "survived"} | {
    name: name for name in ("velocity_error", "turning_error", "slip", "cost_of_transport")
}
"""Column -> that of `Episodes` it is the mean of."""
_MOST_KEPT = 8192  # episodes; the values of more are no field of a CSV file
PUSHED = {"survival_pushed": 1.0, "survival_pushed_harder": 1.5}
"""Column -> size of every push of its episodes, over that of the environment's strongest."""
_COLUMNS = ("run", "policy", "commit", *_MEASURED, *PUSHED, *(f"{name}_each" for name in _EACH))

OF_EPISODES = ("height_error", "torque", "power", "foothold_error")
"""Columns of `Episodes` that are measured besides, and not kept."""

Columns = dict[str, np.ndarray]


class Played(NamedTuple):
    """Results of one policy."""

    means: Columns  # columns of `evaluations.csv` that are of the episodes, (1,) each
    each: Columns
    """Those of them that are means of the episodes, (E,) each, in the order of their seeds; empty
    where they were not kept."""

    @classmethod
    def by(cls, player: Player, count: int, seed: int) -> "Played":
        """Play so many episodes, and measure more than is kept."""
        episodes = play_player(player, count, seed, count)
        names = _EACH | dict(zip(OF_EPISODES, OF_EPISODES, strict=True))
        each = {column: getattr(episodes, name) for column, name in names.items()}
        means = summary(episodes) | {name: each[name].mean() for name in OF_EPISODES}
        return cls({name: np.array([mean]) for name, mean in means.items()}, each)

    @classmethod
    def of(cls, row: Mapping[str, str]) -> "Played":
        """Read a row of what is kept."""
        each = {name: row.get(f"{name}_each") or "" for name in _EACH}
        return cls(
            {name: np.array([float(row[name])]) for name in _MEASURED}
            | {name: np.array([float(row.get(name) or "nan")]) for name in PUSHED},
            {name: np.array(its.split(), float) for name, its in each.items() if its},
        )


@dataclass(frozen=True)
class Falls:
    """Number of episodes, of some runs together, that ended in a fall."""

    fallen: int
    episodes: int

    @classmethod
    def of(cls, played: Sequence[Played]) -> "Falls":
        """Count those of runs, of as many episodes each."""
        known = [(its.means["episodes"].item(), its.means["survival"].item()) for its in played]
        fallen = sum((1.0 - survival) * episodes for episodes, survival in known)
        return cls(round(fallen), round(sum(episodes for episodes, _ in known)))

    def __str__(self) -> str:
        """Write it as "16 of 1,000"."""
        return f"{self.fallen:,} of {self.episodes:,}"


def fresh_file(study: Study) -> Path:
    """Return where it is kept: beside the runs, which studies may share."""
    return study.runs / "fresh_episodes.csv"


def level_file(study: Study) -> Path:
    """Return where it is kept what policies that learn nothing do in evaluations of trainings."""
    return study.runs / "without_learning.csv"


def measure(study: Study, episodes: int, tell: Tell) -> None:
    """Play the policies of a study that are at their end, unless they have been, and keep it.

    Raises:
        RunError: a policy that cannot be read, one that was evaluated from the same seeds, or what
            is kept is of another number of episodes; nothing is lost then.
        InvalidValueError: nothing can be written beside the runs.
    """
    file = fresh_file(study)
    check_folder(file.parent, "runs")
    rows = {kept: _rows(kept) for kept in (file, level_file(study))}
    other = {int(float(row["episodes"])) for row in rows[file].values()} - {episodes}
    if other:
        raise RunError(
            f"{file}: is of {min(other)} episodes, not of {episodes}. Expected as many, or no such "
            "file: without it all is measured anew."
        )
    wanted = [(file, cell, FIRST_SEED, episodes) for cell in _finished(study)]
    for cell in study.unlearnt:
        its = cell.config.eval
        wanted.append((level_file(study), cell, its.seed, its.episodes))
    known = [_of_today(rows[kept_in], cell) for kept_in, cell, *_ in wanted]
    waiting = [
        (its, *each)
        for its, each in zip(known, wanted, strict=True)
        if its is None or (each[0] is file and not all(its.get(name) for name in PUSHED))
    ]
    for cell in (cell for _, _, cell, *_ in waiting if not cell.policy):
        check_unseen(FIRST_SEED, episodes, cell.config.to_json(), cell.config.folder)
    now = versions()  # of what plays
    commit = str(now["commit"] or "unknown")[:12]
    played_with = f"{commit} and changes" if now["uncommitted_changes"] else commit
    for k, (there, kept_in, cell, seed, count) in enumerate(waiting):
        name, its_rows = cell.config.folder.name, rows[kept_in]
        tell(k, len(waiting), name)
        row = there or {"run": name, "commit": played_with} | _played(cell, seed, count)
        its_rows[name] = row | (_pushed(cell, seed, count) if kept_in is file else {})
        table = [dict.fromkeys(_COLUMNS, "") | its_rows[run] for run in sorted(its_rows)]
        write(kept_in, to_csv(_COLUMNS, table))


def _played(cell: Cell, seed: int, count: int) -> dict[str, str]:
    """Play so many episodes, and return what they were as columns of what is kept."""
    its = Played.by(Player.of_cell(cell), count, seed)
    row = {"policy": policy_digest(cell)}
    row |= {name: repr(its.means[name].item()) for name in _MEASURED}
    for column in _EACH if count <= _MOST_KEPT else ():
        row[f"{column}_each"] = " ".join(f"{value:.7g}" for value in its.each[column])
    return row


def _pushed(cell: Cell, seed: int, count: int) -> dict[str, str]:
    """Return which share stays up under hard pushes, as columns; NaN where there are none."""
    player = Player.of_cell(cell)
    greatest, row = environment(player).resolved()["push_weights"][1], dict.fromkeys(PUSHED, "nan")
    for column, share in PUSHED.items() if greatest else ():
        args = player.env_args | {"push_force": None, "push_weights": (share * greatest,) * 2}
        survived = play_player(replace(player, env_args=args), count, seed, count).survived
        row[column] = repr(float(survived.mean()))
    return row


def levels(study: Study) -> dict[str, Played]:
    """Return what policies that learn nothing do in evaluations of trainings, by folder."""
    rows = _rows(level_file(study))
    known = {cell.config.folder.name: _of_today(rows, cell) for cell in study.unlearnt}
    return {name: Played.of(row) for name, row in known.items() if row is not None}


def kept(study: Study) -> tuple[dict[str, Played], list[str]]:
    """Return what is kept of the policies of a study that are at their end, by the name of the run.

    Only policies that have not changed since they were measured count. Returns warnings, too, if
    others were measured, or if the code changed in between. Raises RunError if the file cannot be
    read.
    """
    rows = _rows(fresh_file(study))
    found, changed, commits = {}, [], set()
    for cell in _finished(study):
        name = cell.config.folder.name
        row = _of_today(rows, cell)
        if row is not None:
            found[name] = Played.of(row)
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


def _finished(study: Study) -> list[Cell]:
    return [cell for arm in arms(study) for cell in arm.finished()]


def _of_today(rows: dict[str, dict[str, str]], cell: Cell) -> dict[str, str] | None:
    """Return the row of a cell if its policy is still the one that was measured."""
    row = rows.get(cell.config.folder.name)
    return row if row is not None and row["policy"] == policy_digest(cell) else None


def _rows(file: Path) -> dict[str, dict[str, str]]:
    """Return what is kept, by the name of the run; nothing where there is no such file."""
    rows = read_rows(file)
    try:
        for row in rows:
            played = Played.of(row)
            values, episodes = [its.item() for its in played.means.values()], float(row["episodes"])
            counts = {float(len(its)) for its in played.each.values()} - {episodes}
            if any(map(math.isinf, values)) or not episodes >= 1.0 or counts:
                raise ValueError("a number that is none")
        return {row["run"]: row for row in rows if row["policy"]}
    except (KeyError, TypeError, ValueError) as error:
        raise RunError(f"{file}: not the table of eval.study, or corrupt ({error}).") from error
