"""Compare action layers of your own with those of this package, without a policy.

python -m eval.layers my_layer.py --out runs/layers.html

A fixed set of tasks, robots and seeds: every layer plays its zero action from the same starts, to
the same commands, under the same pushes. The score of a robot is the share of the greatest return
that it earns in an episode; who falls earns nothing from there on. The file is run as a program of
your own: it has to call `register_layer`, see docs/own_task_and_layer.md.
"""

import hashlib
import math
import shlex
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import tyro

import fbid_gym
from eval.page.docs import DOCS, command_block, markdown_table, splice, spliced
from eval.page.figures import bars, colours_of
from eval.page.html import render
from eval.results import Estimate
from eval.statistics import Chance, holm, improvement, over_tasks, p_value
from eval.wording import interval, number, percent
from eval.zero_actions.__main__ import measured, short
from eval.zero_actions.measures import Row
from eval.zero_actions.tables import TABLES, ZeroActionConfig, cases
from fbid_gym.actions import LAYERS, make_layer
from fbid_gym.envs.chunks import NUM_ENVS
from fbid_gym.errors import FbidError, RunError
from fbid_gym.options import Choice, Each, Number, Whole
from fbid_gym.runtime.config import EnvConfig
from train.command import run_command
from train.environments import run_file
from train.runs.files import check_output, write

TABLE = TABLES["layers"]
_PAGE = DOCS / "layer_benchmark.md"
_SAMPLES, _CONFIDENCE = 2000, 0.95


@dataclass(frozen=True)
class LayersConfig:
    """Compare action layers of your own with those of this package, without a policy."""

    files: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Python files that register layers; they are run. None: the package's layers alone."""
    against: Annotated[tuple[str, ...], Each(Choice(LAYERS, "action layer"))] = tuple(LAYERS)
    """Layers of the package to compare with; the table's p-values are against the best of them."""
    only: tuple[str, ...] = ()
    """Only some rows, such as robot=go1 task=walk. Default: all."""
    episodes: Annotated[int, NUM_ENVS] = TABLE.episodes
    """Robots side by side, one episode each."""
    seconds: Annotated[float, Number(0.02, 10_000.0, "s")] = TABLE.seconds
    """Length of an episode."""
    seed: Annotated[int, Whole(0, 2**31)] = 0
    """Robot i starts from seed + i."""
    out: Path = Path("runs/layers.html")
    """The page. Its rows go into a file of the same name ending in .csv; rows that this has, of the
    same file of a layer, are not measured again: the same command goes on after an interruption."""
    overwrite: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Measure anew what the file has already, as after a change of what a layer imports."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Write the table into its page of docs/, too."""


class LayerScore(NamedTuple):
    """Score of a layer over all tasks."""

    score: Estimate  # mean over tasks of the interquartile mean over robots
    better: Estimate
    """Probability that one of its robots earns more than one of the best of the package."""
    p_value: float
    """Of that, over all tasks, adjusted for the number of layers (Holm); NaN for itself."""


def registered(files: Sequence[Path]) -> dict[str, str]:
    """Run files, and return the layers that they register, with the digest of their file.

    Raises:
        RunError: a file that cannot be run, or that registers none.
    """
    found: dict[str, str] = {}
    for file in files:
        before = dict(LAYERS)
        run_file(file)
        own = [name for name, of in LAYERS.items() if before.get(name) is not of]
        if not own:
            raise RunError(f"{file}: registers no layer. Expected a call of register_layer.")
        found |= dict.fromkeys(own, hashlib.sha256(file.read_bytes()).hexdigest()[:8])
    return found


def check_builds(layers: Sequence[str], config: ZeroActionConfig) -> None:
    """Build each layer for each robot; RunError where one does not, whatever it raises."""
    for case in cases(config):
        arguments, layer = case.measure.args[0], case.cells["layer"]  # type: ignore[attr-defined]
        if layer not in layers:
            continue
        known = EnvConfig.of(arguments)
        robot = known.load_robot()
        try:
            make_layer(layer, robot, known.control_hz, known.make_task(robot).kind)
        except Exception as error:  # code of the user's
            kind = "" if isinstance(error, FbidError) else f"{type(error).__name__}: "
            said = kind + " ".join(str(error).split())
            raise RunError(f"Layer {layer!r} cannot be built for {robot.name}: {said}") from error


def scores(rows: Sequence[Row]) -> dict[str, list[np.ndarray]]:
    """Return layer -> for each task the scores of its robots, (N,)."""
    found: dict[str, list[np.ndarray]] = {}
    for row in rows:
        each = np.array([float(word) for word in row["score_of_each"].split()])
        found.setdefault(row["layer"], []).append(each)
    return found


def standings(rows: Sequence[Row], ours: Sequence[str]) -> tuple[str, dict[str, LayerScore]]:
    """Return the best layer of the package, and what every layer comes to, the best first."""
    of = scores(rows)
    rng = np.random.default_rng(0)
    chance = Chance(rng, _SAMPLES, _CONFIDENCE)
    means = {layer: over_tasks(tasks, chance) for layer, tasks in of.items()}
    best = max(ours, key=lambda layer: means[layer].value)
    others = [layer for layer in of if layer != best]
    alone = [p_value(*_centred(of[x], of[best]), rng) for x in others]
    p_values = dict(zip(others, holm(alone), strict=True))
    found = {}
    for layer in sorted(of, key=lambda layer: -means[layer].value):
        better = improvement(of[layer], of[best], chance)
        found[layer] = LayerScore(means[layer], better, p_values.get(layer, math.nan))
    return best, found


def _centred(x: list[np.ndarray], y: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The scores of two layers over all tasks, each less what both layers' robots earn in it."""
    means = [np.mean(task) for task in zip(x, y, strict=True)]
    own, other = (
        np.concatenate([scores - mean for scores, mean in zip(side, means, strict=True)])
        for side in (x, y)
    )
    return own, other


def run(config: LayersConfig, command: Sequence[str]) -> None:
    """Run the files, measure, write the page; what can be refused is refused before."""
    check_output(config.out, "out", (".html", ".htm"))
    if config.write_docs:
        spliced(_PAGE, "")
    own = registered(config.files)
    what = ZeroActionConfig(
        "layers",
        layers=(*own, *config.against),
        only=config.only,
        episodes=config.episodes,
        seconds=config.seconds,
        seed=config.seed,
    )
    check_builds(list(own), what)
    file = config.out.with_suffix(".csv")
    # They say of which code a layer is: what has changed since is measured anew.
    todo = [
        case._replace(
            cells=case.cells | {"code": own.get(case.cells["layer"], fbid_gym.__version__)}
        )
        for case in cases(what)
    ]
    rows = list(measured(todo, TABLE, file, config.overwrite))
    best, found = standings(rows, config.against)
    tables = summary(best, found), short(TABLE, rows)
    text = "\n\n".join(markdown_table(*each) for each in tables)
    print(f"\n{text}")
    write(config.out, page(rows, best, found, list(own), command))
    print(f"wrote {config.out}")
    if config.write_docs:
        said = f"{config.episodes} robots each, {config.seconds:g} s. By"
        splice(_PAGE, f"{said}\n\n{command_block(command)}\n\n{text}")


def summary(best: str, found: dict[str, LayerScore]) -> tuple[list[str], list[list[str]]]:
    """Return heads and lines of the table over all tasks."""
    heads = ["layer", "score", f"better than {best}", "p"]
    return heads, [
        [
            layer,
            interval(its.score),
            interval(its.better, percent) if layer != best else "–",
            number(its.p_value, 2),
        ]
        for layer, its in found.items()
    ]


def page(
    rows: Sequence[Row], best: str, found: dict[str, LayerScore], own: Sequence[str],
    command: Sequence[str],
) -> str:  # fmt: skip
    """Lay out the page."""
    of, colours = scores(rows), colours_of(found)
    groups = list(dict.fromkeys(f"{row['robot']}: {row['task']}" for row in rows))
    chart = bars(
        ["\n".join(textwrap.wrap(group, 14)) for group in groups],
        [(n, colours[n], [float(np.mean(x)) for x in of[n]]) for n in found],
        "Score: mean over robots",
        top=1.1,
    )
    return render(
        "layers.html",
        title="Action layers without a policy",
        own=own,
        found=found,
        first=rows[0],
        chart=chart,
        standings=summary(best, found),
        tasks=short(TABLE, rows),
        best=best,
        level=percent(_CONFIDENCE),
        samples=_SAMPLES,
        command=shlex.join(command),
    )


main = partial(run_command, "eval.layers", LayersConfig, run, about=__doc__, told=True)


if __name__ == "__main__":
    sys.exit(main())
