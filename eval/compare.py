r"""Compare action layers: runs in, one HTML page out, that of a study of these runs.

python -m eval.compare runs/a-s0 runs/a-s1 runs/b-s0 runs/b-s1 --out report.html
"""

import math
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from eval.comparable import check_comparable, check_unseen, group
from eval.results import greatest_return
from eval.robustness.arms import PlayedArm
from eval.robustness.curves import Budget, Robustness, at, measure
from eval.robustness.factors import BY_NAME
from eval.rollout import Player
from eval.study.films import Clips, film
from eval.study.findings import cell_found, together
from eval.study.fresh import Played
from eval.study.page import page
from eval.study.results import MEASURES, ArmFound, CellFound, Findings, Settings
from eval.study.wording import headline
from eval.wording import number
from fbid_gym.checks import check_choices
from fbid_gym.errors import FbidError
from fbid_gym.options import Each, Number, Whole
from train.command import run_command
from train.environments import register
from train.progress import Tell, progress
from train.runs.command_line import command_again
from train.runs.files import check_output, to_json, write
from train.runs.proportional import ZERO
from train.runs.reading import Run, layer_name, load
from train.runs.robots import another, chosen
from train.runs.training import Status

PUSH = BY_NAME["push"]


@dataclass(frozen=True)
class CompareConfig:
    """Compare action layers: runs in, one HTML page out, and its numbers as JSON beside it."""

    runs: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Run folders, exported policies or `shipped:NAME`, all of one environment."""
    out: Path = Path("report.html")
    """The page. Its numbers go into a file of the same name ending in .json."""
    reference: str | None = None
    """Layer, in the words of the page, that the others are set against. Default: the last."""
    register: tuple[str, ...] = ()
    """Modules to import first, which register environments of yours."""
    robot: str | None = None
    """Play all on this one: a built-in robot, an MJCF, a URDF, a robot.toml or a robot.zip."""
    feet: tuple[str, ...] = ()
    """Of your own robot: names of bodies, sites or spheres, or '{"left": ["heel", "toe"]}'."""
    robots: tuple[str, ...] = ()
    """Instead of one, with as many episodes of each: built-in ones, files, "zoo:quadruped:0-15"."""
    episodes: Annotated[int, Whole(1, 65_536)] = 50
    """Fresh ones of each run, and of the zero action of each layer."""
    pushes: Annotated[tuple[float, ...], Each(Number(0.0, 1000.0), least=0)] = PUSH.values
    """Sizes of push at which survival is measured, shares of the robot's weight; it may be none."""
    push_episodes: Annotated[int, Whole(1, 65_536)] = 16
    """Of each run at every size of push."""
    push_seconds: Annotated[float, Number(0.1, 10_000.0, "s")] = 5.0
    """Length of these episodes, s."""
    video_seconds: Annotated[float, Number(0.0, 600.0, "s")] = 6.0
    """Length of the clips, s. 0: none."""
    video_push: Annotated[float, Number(0.0, 1000.0)] | None = None
    """Size of the pushes in the clips, share of the robot's weight. Default: those of training."""
    settings: Annotated[Settings, tyro.conf.arg(name="")] = field(default_factory=Settings)
    """How the runs are put together."""


def named(runs: Sequence[Run]) -> dict[str, Run]:
    """Return the runs by the names of their folders, or by their paths where two have one name."""
    names = [run.path.name for run in runs]
    return {name if names.count(name) == 1 else str(run.path): run
            for name, run in zip(names, runs, strict=True)}  # fmt: skip


def players_of(runs: Mapping[str, Run]) -> dict[str, Player]:
    """Return who plays, by name: the runs, and behind them the zero action of each layer."""
    trained = {name: Player.of(run) for name, run in runs.items()}
    return trained | {_zero(run): Player.of(run, trained=False) for run in runs.values()}


def arms_of(runs: Mapping[str, Run]) -> list[ArmFound]:
    """Return the runs of each layer as an arm, and behind them the zero action of each layer."""
    names, found, zeros = {run.path: name for name, run in runs.items()}, [], {}
    for name, its in group(list(runs.values())).items():
        env_id, env_args = its[0].policy.env_id, its[0].policy.env_args
        layer, most = layer_name(env_args), greatest_return(env_id, env_args)
        cells = [_cell(names[run.path], run) for run in its]
        found.append(ArmFound(env_id, name, layer, most, cells))
        zero = _zero(its[0])
        zeros[zero] = ArmFound(env_id, zero, layer, most, [], [zero], ZERO)
    return [*found, *zeros.values()]


def _zero(run: Run) -> str:
    return f"{layer_name(run.policy.env_args)}, zero action"


def _cell(name: str, run: Run) -> CellFound:
    """Return a run as a training of a study; of an exported policy its steps alone are known."""
    again = "" if run.config is None else command_again(run.config, run.path)
    cell = cell_found(run.path, name, run.seed, Status("done", ""), again)
    if cell.begun:
        return cell
    steps, unknown = [float(run.policy.trained_steps)], [math.nan]
    curves = {measure.name: unknown for measure in MEASURES}
    return replace(cell, steps=steps, wall=unknown, fallen=unknown, curves=curves)


def compared(
    runs: Sequence[Run], config: CompareConfig, tell: Tell = lambda done, total, what: None
) -> Findings:
    """Play fresh episodes by every run and every zero action, and put them together.

    Raises:
        FbidError: runs that cannot be compared, that were evaluated from the same seeds, or that
            cannot play; or there is no arm of the name of the reference.
    """
    warnings, by_name, settings = check_comparable(runs), named(runs), config.settings
    its, players, played = arms_of(by_name), players_of(by_name), dict[str, Played]()
    reference = config.reference or [arm.name for arm in its if arm.cells][-1]
    check_choices("reference", (reference,), [arm.name for arm in its])
    for run in runs:
        check_unseen(settings.seed, config.episodes, run.config or {}, run.path)
    for name, player in players.items():
        tell(len(played), len(players), name)
        played[name] = Played.by(player, config.episodes, settings.seed)
    for name, run in by_name.items():
        warnings += _changed(name, run, played[name])
    versions = next((run.versions for run in runs if run.config is not None), runs[0].versions)
    bare = Findings("compare", "", reference, settings, its, warnings, versions)
    return together(bare, played, _evaluated(by_name, players))


def _evaluated(runs: Mapping[str, Run], players: Mapping[str, Player]) -> dict[str, Played]:
    """Play the zero actions in the episodes that trainings were evaluated in, if these are known.

    On another robot they would not be the same.
    """
    its = next((run.config["eval"] for run in runs.values() if run.config is not None), None)
    other = (another(run.path, run.env_args, run.robot) for run in runs.values())
    if its is None or any(other):
        return {}
    zeros = players.keys() - runs.keys()
    return {name: Played.by(players[name], its["episodes"], its["seed"]) for name in sorted(zeros)}


def _changed(name: str, run: Run, played: Played) -> list[str]:
    """Warn if fresh episodes do not return what the last evaluation of the same policy did."""
    if run.curve is None:
        return []
    returned = played.each["return_mean"]
    last, now = float(run.curve.returns[-1]), float(returned.mean())
    error = math.hypot(
        float(run.curve.spread[-1]) / math.sqrt(run.curve.episodes[-1]),
        float(returned.std()) / math.sqrt(len(returned)),
    )
    if abs(now - last) <= 5.0 * error + 0.01 * abs(last):
        return []
    return [
        f"{name} returns {number(now)} now and {number(last)} at its last evaluation in training: "
        "the environment, or the policy, is not what it was."
    ]


def under_pushes(
    found: Findings, players: Mapping[str, Player], config: CompareConfig, tell: Tell
) -> Robustness:
    """Play every arm under pushes of each size; FbidError where the environment is none of ours."""
    short = {"episode_seconds": config.push_seconds}
    tried = []
    for arm in found.arms:
        runs = arm.fresh.runs if arm.fresh else []
        its = (replace(players[run], env_args={**players[run].env_args, **short}) for run in runs)
        tried.append(PlayedArm(arm.name, arm.layer, tuple(its), () if arm.policy else tuple(runs)))
    factor = replace(PUSH, values=tuple(sorted({*config.pushes})))
    return measure(tried, [factor], Budget(config.push_episodes, config.settings.seed), tell)


def run(config: CompareConfig, command: list[str]) -> None:
    """Compare, then write the page and its numbers."""
    console = Console()
    check_output(config.out, "out", (".html", ".htm"))
    register(config.register)
    robot = chosen(config.robot, config.feet, config.robots)
    runs = [load(path, robot, config.robots) for path in config.runs]
    with progress(console, "fresh episodes") as tell:
        found = compared(runs, config, tell)
    players, missing = players_of(named(runs)), list[str]()
    stood, clips = dict[str, Robustness](), Clips()
    if config.pushes:
        try:
            with progress(console, "pushes") as tell:
                stood[found.arms[0].env_id] = under_pushes(found, players, config, tell)
        except FbidError as error:  # the rest stands without it
            missing.append(f"Survival under pushes is not known: {error}")
    if config.video_seconds > 0:
        push = config.video_push
        with progress(console, "clips") as tell:
            clips, lost = film(
                replace(found, arms=[arm for arm in found.arms if arm.cells]),
                lambda name: players[name] if push is None else at(players[name], PUSH, push),
                config.video_seconds,
                tell,
            )
        missing += lost
    said = headline(found, *stood.values())
    found = replace(found, title=said, warnings=[*found.warnings, *missing])
    kept = {env_id: its.to_dict() for env_id, its in stood.items()}
    write(config.out.with_suffix(".json"), to_json({**asdict(found), "robustness": kept}))
    write(config.out, page(found, clips, stood, shlex.join(command)))
    for warning in found.warnings:
        console.print(f"warning: {warning}", style="yellow", markup=False, highlight=False)
    console.print(said, markup=False, highlight=False)
    console.print(f"wrote {config.out}", markup=False, highlight=False)


main = partial(run_command, "eval.compare", CompareConfig, run, about=__doc__, told=True)


if __name__ == "__main__":
    sys.exit(main())
