r"""Play a study's policies on unseen robots, and compare numbers of training robots.

python -m eval.scaling studies/bodies.toml --write-docs

`train.sweep` trains what a study names; this plays every finished training on the robots that its
[transfer] names, with the zero action and the proportional law of each layer, and keeps what they
did beside the runs: what is kept is not played again. It makes a figure of that, robots learnt with
against return and falls on unseen ones, and a table of robots.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import tyro
from rich.console import Console

from eval.page.docs import DOCS, markdown_table, splice, spliced
from eval.page.figures import Series, panel, sheet
from eval.statistics import holm, signed_rank
from eval.study.cells import policy_digest
from eval.transfer import COLUMNS, ZERO
from eval.wording import capital, number, over_seeds, percent
from fbid_gym.envs.registered import registered
from fbid_gym.errors import RunError
from fbid_gym.options import Whole
from fbid_gym.robots.several import each_name
from train.command import run_command
from train.runs.config import cores
from train.runs.files import check_folder, write
from train.runs.jobs import Job, Progress, run_jobs
from train.runs.proportional import PREFIX
from train.runs.reading import layer_name
from train.runs.study import Cell, Study, arms, check_cells, environment_name, read_study
from train.runs.tables import read_rows, to_csv
from train.runs.training import is_finished


@dataclass(frozen=True)
class ScalingConfig:
    """Play the policies of a study on robots that they never saw; show what bodies are worth."""

    study: tyro.conf.Positional[Path]
    """TOML file with [transfer], see `train.runs.study`."""
    runs: Path | None = None
    """Folder of the runs; by default the one that the study names, or runs/NAME."""
    workers: Annotated[int, Whole(1, 1024)] | None = None
    """Policies played at the same time, one core each. Default: as many as there are cores."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Write the rows to docs/NAME_unseen.csv, after the study's name, a figure to .svg if arms have
    learnt with different numbers of robots, and the table between its marks into the study's page
    of docs/."""


class PlayedUnseen(NamedTuple):
    """Results of an arm's policies, or of unlearnt ones, on the unseen robots."""

    name: str  # of the arm, or of the law
    layer: str  # in words
    bodies: int  # number of robots that it learnt with; 0 of laws
    seen: frozenset[str]  # names of those
    returned: dict[str, list[float]]  # robot -> mean return of each seed
    up: dict[str, list[float]]  # robot -> share of the episodes without a fall, of each seed

    def over(self, what: str, robots: list[str]) -> np.ndarray:
        """(S,) mean of "returned" or "up" over robots, of each seed."""
        values = getattr(self, what)
        return np.array([values[robot] for robot in robots if robot in values]).mean(axis=0)


def main(config: ScalingConfig) -> int:
    """Play what has not been, then print and write; return the exit status."""
    console = Console(width=200, highlight=False)
    study = read_study(config.study, config.runs)
    check_cells(study)
    page, part = DOCS / f"{study.page}.md", f"{study.name}, unseen robots"
    if study.transfer is None:
        raise RunError(f"{config.study}: has no [transfer]. Expected one, with unseen robots.")
    if len({arm.env for arm in arms(study)}) > 1:
        raise RunError(f"{config.study}: has several environments. Expected one for all arms.")
    if config.write_docs:
        spliced(page, "", part)  # refuses a page without marks before anything is played
    check_folder(study.runs / "transfer", "runs")
    waiting = list(jobs(study))
    failed = run_jobs(waiting, config.workers or cores(), console, keep_going=True)
    rows = kept(study)
    if not rows:
        raise RunError(f"{study.runs}: nothing has been played. Expected finished trainings.")
    found = played(study, rows)
    said = table(study, rows, found)
    console.print(said, markup=False, soft_wrap=True)
    if config.write_docs:
        name = f"{study.name}_unseen"
        write(DOCS / f"{name}.csv", to_csv(("arm", "layer", "seed", *COLUMNS), rows))
        if len({one.bodies for one in found if one.bodies}) > 1:
            write(DOCS / f"{name}.svg", drawn(found))
            said = f"{_FIGURE.format(name)}\n\n{said}"
        splice(page, f"{said}\n\n[All rows]({name}.csv).", part)
    return 1 if failed else 0


_FIGURE = (
    "![Robots learnt with against return and falls on unseen ones]({}.svg)\n\nBands: least to "
    "greatest seed. Dashed: the zero action of the layer; lines without dots: its proportional law."
)


def _tables(study: Study) -> dict[Path, tuple[Cell, bool]]:
    """Map CSV files to their finished cell, and whether it is of the laws in its environment.

    Names change with the policy, the environment and the robots, so that what was played before
    such a change does not count. Cells alike but for their seeds have the same laws.
    """
    found: dict[Path, tuple[Cell, bool]] = {}
    for cell in (cell for cell in study.cells if is_finished(cell.config)):
        config = cell.config
        rest = {n: v for n, v in config.make_args().items() if n not in ("robot", "robots")}
        laws = f"{environment_name(config.env)}-{config.action_layer}-laws"
        own = (config.folder.name, policy_digest(cell)), (laws, json.dumps(rest, sort_keys=True))
        for of_laws, (name, what) in enumerate(own):
            digest = sha256((repr(study.transfer) + what).encode()).hexdigest()[:8]
            found.setdefault(
                study.runs / "transfer" / f"{name}-{digest}.csv", (cell, bool(of_laws))
            )
    return found


def jobs(study: Study) -> Iterator[Job]:
    """Yield what has to be played: each finished policy, and once each layer's laws."""
    transfer = study.transfer
    assert transfer is not None
    for out, (cell, laws) in _tables(study).items():
        if not out.is_file():
            gain = ("--gain", str(transfer.gain)) if laws and transfer.gain is not None else ()
            command = (
                *(sys.executable, "-m", "eval.transfer", str(cell.config.folder)),
                *("--robots", *transfer.unseen, "--episodes", str(transfer.episodes)),
                *("--who", "laws" if laws else "policies", *gain, "--out", str(out)),
            )
            yield Job(out.stem, command, out.with_suffix(".log"), partial(_progress, out))


def _progress(out: Path) -> Progress:
    return Progress(float(out.is_file()))


def kept(study: Study) -> list[dict[str, Any]]:
    """Return what has been played, each row with arm, layer and seed; of laws with the layer."""
    found = list[dict[str, Any]]()
    for file, (cell, laws) in _tables(study).items():
        arm, seed = ("", "") if laws else (cell.arm, cell.config.seed)
        known = {"arm": arm, "seed": seed, "layer": layer_name(cell.config.make_args())}
        found += [known | row for row in read_rows(file)]
    return found


def played(study: Study, rows: list[dict[str, Any]]) -> list[PlayedUnseen]:
    """Return what each arm and each law did; arms in the order of the study, then laws."""
    found = []
    for arm in arms(study):
        own = [row for row in rows if row["arm"] == arm.name]
        if own:
            config = arm.cells[0].config
            usual = str(registered(config.env).kwargs["robot"])
            robots = each_name(config.robots or (config.robot or usual,))
            found.append(_played(arm.name, robots, own))
    laws = [row for row in rows if not row["arm"]]
    for which in dict.fromkeys((row["policy"], row["layer"]) for row in laws):
        own = [row for row in laws if (row["policy"], row["layer"]) == which]
        found.append(_played(which[0], (), own))
    return found


def _played(name: str, learnt_with: tuple[str, ...], rows: list[dict[str, Any]]) -> PlayedUnseen:
    returned, up = dict[str, list[float]](), dict[str, list[float]]()
    for row in rows:
        if int(row["episodes"]):
            returned.setdefault(row["robot"], []).append(float(row["return"]))
            up.setdefault(row["robot"], []).append(float(row["up"]))
    layer = str(rows[0]["layer"])
    return PlayedUnseen(name, layer, len(learnt_with), frozenset(learnt_with), returned, up)


def unseen(found: list[PlayedUnseen]) -> list[list[str]]:
    """Return the robots that no arm has learnt with, those first on which most can be played.

    Once for each set of robots on which an arm can act: joint targets need as many joints as the
    policy has learnt with, PD such joints as it can hold.
    """
    seen = frozenset[str]().union(*(one.seen for one in found))
    sets = {tuple(n for n in one.returned if n not in seen): None for one in found if one.bodies}
    return sorted(map(list, filter(None, sets)), key=len, reverse=True)


def able(found: list[PlayedUnseen], robots: list[str]) -> list[PlayedUnseen]:
    """Return those who can act on all of these robots."""
    return [one for one in found if one.returned.keys() >= set(robots)]


def layer_words(found: list[PlayedUnseen]) -> dict[str, str]:
    """Return how layers are called: without their options where that is enough."""
    layers = list(dict.fromkeys(one.layer for one in found))
    short = [layer.partition(" (")[0] for layer in layers]
    return dict(zip(layers, short if len(set(short)) == len(layers) else layers, strict=True))


def drawn(found: list[PlayedUnseen]) -> str:
    """Return the scaling figure as SVG: bodies learnt with, against what is done on unseen ones.

    A row for each set of `unseen`, a curve for each layer: the mean over robots and seeds, its band
    from the least seed to the greatest; dashed, the zero action of the layer; without dots, its
    proportional law.
    """
    panels, names = list[str](), layer_words(found)
    most = max(one.bodies for one in found)
    for robots in unseen(found):
        those = able(found, robots)
        for what, title in {"returned": "return", "up": "share without a fall"}.items():
            mean = partial(PlayedUnseen.over, what=what, robots=robots)
            series = []
            for colour, (layer, name) in enumerate(names.items()):
                beside = [one for one in those if one.layer == layer]
                own = sorted((one for one in beside if one.bodies), key=lambda one: one.bodies)
                if not own:
                    continue
                x = [float(np.log2(one.bodies)) for one in own]
                middle, low, high = ([float(f(mean(o))) for o in own] for f in (np.mean, min, max))
                level = {one.name: mean(one).item() for one in beside if not one.bodies}
                zero = next(
                    ([v] * len(x) for law, v in level.items() if law.startswith(ZERO)), None
                )
                series.append(Series(name, colour, x, middle, low, high, dashed=zero, dots=True))
                series += [
                    Series(f"one gain, {name}", colour, [0.0, float(np.log2(most))], [v, v])
                    for law, v in level.items()
                    if law.startswith(PREFIX)
                ]
            title = capital(f"{title} on {len(robots)} unseen robots")
            panels.append(panel(series, title, "robots learnt with", x_format=_power_of_two))
    return sheet(panels)


def _power_of_two(x: float) -> str:
    return f"{2.0**x:.0f}"


def table(study: Study, rows: list[dict[str, Any]], found: list[PlayedUnseen]) -> str:
    """Return how all did together, and on each robot, as Markdown."""
    tables, names = list[str](), layer_words(found)
    heads = ("arm", "layer", "robots learnt with", "seeds", "return", "up", "> zero", "> one gain")
    for robots in unseen(found):
        those = able(found, robots)
        better, together = compared(those, robots), []
        for one in those:
            returned, up = (one.over(what, robots) for what in ("returned", "up"))
            than = [better.get((one.name, prefix), "–") for prefix in (ZERO, PREFIX)]
            cells = [one.name, names[one.layer], str(one.bodies or "–"), str(len(returned))]
            together.append([*cells, over_seeds(returned, number), over_seeds(up, percent), *than])
        who = "all arms" if len(those) == len(found) else "these arms"
        said = f"{len(robots)} robots that nobody learnt with and on which {who} can act:"
        tables.append(f"{said}\n\n{markdown_table(heads, together, 2)}")
    said = (
        "Means over robots and over seeds, and (least to greatest seed). Last columns: on how many "
        "of the robots an arm's mean return is above that of its layer's zero action, and of its "
        "proportional law; p of Wilcoxon's signed-rank test over the robots, by Holm's method for "
        "all of these columns of a table."
    )
    each = []
    first = {row["robot"]: row for row in rows}
    then = (
        "Return, and share of the episodes without a fall, on each robot; in brackets, of who "
        "learnt with it."
    )
    for robot, row in first.items():
        cells = [f"`{robot}`", row["mass"], row["joints"]]
        for one in found:
            if robot not in one.returned:
                cells.append("cannot act")
                continue
            value = f"{np.mean(one.returned[robot]):.0f}, {percent(float(np.mean(one.up[robot])))}"
            cells.append(f"({value})" if robot in one.seen else value)
        each.append(cells)
    columns = ("robot", "kg", "joints", *(one.name for one in found))
    return "\n\n".join([said, *tables, then, markdown_table(columns, each, 1)])


def compared(found: list[PlayedUnseen], robots: list[str]) -> dict[tuple[str, str], str]:
    """Say on how many robots each arm earns more than a law of its layer, and how surely it does.

    Returns:
        By the name of the arm and the prefix of the law's.
    """
    pairs = {
        (one.name, prefix): np.array(
            [np.mean(one.returned[robot]) - np.mean(law.returned[robot]) for robot in robots]
        )
        for one in found
        for law in found
        for prefix in (ZERO, PREFIX)
        if one.bodies and law.layer == one.layer and law.name.startswith(prefix)
    }
    p_values = holm([signed_rank(more) for more in pairs.values()])
    return {
        which: f"{(more > 0.0).sum()} of {len(robots)}, p = {p:.2g}"
        for (which, more), p in zip(pairs.items(), p_values, strict=True)
    }


if __name__ == "__main__":
    sys.exit(run_command("eval.scaling", ScalingConfig, main, about=__doc__))
