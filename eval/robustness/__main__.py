r"""Measure robustness to conditions outside the training: one page, and its numbers beside it.

python -m eval.robustness runs/a-s0 runs/a-s1 runs/b-s0 --out robustness.html
python -m eval.robustness --env fbid_gym/QuadrupedWalk-v0 \
    --zero-action base_acceleration joint_position
"""

import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console

from eval.page.docs import ROBUSTNESS_PAGE, command_block, splice, spliced
from eval.robustness.arms import PlayedArm, load_arms, zero_action
from eval.robustness.curves import Budget, measure
from eval.robustness.factors import FACTORS
from eval.robustness.page import drawn, page
from eval.robustness.tables import markdown, numbers, said, shown, with_kept
from eval.robustness.wording import headline
from fbid_gym.actions import LAYERS
from fbid_gym.checks import check_choices, check_positive
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Whole
from train.command import run_command
from train.environments import parse_env_args, register
from train.progress import progress
from train.runs.files import check_output, to_json, write
from train.runs.reading import LAYER_ARGS
from train.runs.robots import chosen
from train.runs.tables import read_rows
from train.runs.versions import versions

_OTHERWISE = {name: f"--{name}" for name in ("robot", "robots")}
_OTHERWISE |= {"action_layer": "--zero-action", "episode_seconds": "--seconds"}


@dataclass(frozen=True)
class RobustnessConfig:
    """Try policies where one thing is otherwise than in training."""

    runs: Annotated[tuple[Path, ...], tyro.conf.Positional] = ()
    """Run folders, exported policies, `shipped:NAME` and studies, all of one environment."""
    zero_action: tuple[str, ...] = ()
    """Action layers whose zero action is tried, too."""
    env: str | None = None
    """Environment of the zero actions where there are no runs; of a study, only the runs in it."""
    arms: tuple[str, ...] = ()
    """Of a study, only the arms of these names."""
    factors: tuple[str, ...] = tuple(factor.name for factor in FACTORS)
    """What is varied, one at a time."""
    episodes: Annotated[int, Whole(1, 2**31)] = 64
    """At every value, for every run: robots side by side, each for one episode."""
    seconds: float = 10.0
    """Length of an episode."""
    seed: Annotated[int, Whole(0, 2**63 - 1)] = 20_000
    """Robot i starts from seed + i."""
    out: Path = Path("robustness.html")
    """The page. Its numbers go into files of the same name ending in .json and .csv."""
    register: tuple[str, ...] = ()
    """Modules to import first, which register environments of yours."""
    robot: str | None = None
    """Play all on this one: a built-in robot, an MJCF, a URDF, a robot.toml or a robot.zip."""
    feet: tuple[str, ...] = ()
    """Of your own robot: names of bodies, sites or spheres, or '{"left": ["heel", "toe"]}'."""
    robots: tuple[str, ...] = ()
    """Instead of one, with as many episodes of each: built-in ones, files, "zoo:quadruped:0-15"."""
    env_args: str = "{}"
    """Further environment arguments as a JSON object; they replace those of the runs."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Put the areas into docs/robustness.md, the figures and all numbers beside it. Factors that
    are not tried stay as they are there."""


def run(config: RobustnessConfig, command: list[str]) -> None:
    """Play, then write the page and its numbers; what can be refused is refused before."""
    console = Console()
    register(config.register)
    check_output(config.out, "out", (".html", ".htm"))
    check_choices("factor", config.factors, [factor.name for factor in FACTORS])
    check_choices("action layer", config.zero_action, LAYERS)
    check_positive(seconds=config.seconds)
    budget = Budget(config.episodes, config.seed)
    if config.write_docs:
        spliced(ROBUSTNESS_PAGE, "")
    arms, warnings = gathered(config)
    factors = [factor for factor in FACTORS if factor.name in config.factors]
    with progress(console, "environments") as told:
        found = measure(arms, factors, budget, told)
    found = replace(found, warnings=warnings, versions=versions())
    write(config.out, page(found, command))
    write(config.out.with_suffix(".json"), to_json(found.to_dict()))
    write(config.out.with_suffix(".csv"), numbers(found))
    if config.write_docs:
        found = with_kept(found, read_rows(ROBUSTNESS_PAGE.with_suffix(".csv")))
        write(ROBUSTNESS_PAGE.with_suffix(".csv"), numbers(found))
        write(ROBUSTNESS_PAGE.with_suffix(".svg"), drawn(found))
        splice(ROBUSTNESS_PAGE, f"{said(found)}\n\n{command_block(command)}\n\n{markdown(found)}")
    for warning in found.warnings:
        console.print(f"warning: {warning}", style="yellow", markup=False, highlight=False)
    for table in shown(found):
        console.print(table)
    for name, reason in found.left_out.items():
        console.print(f"left out: {name}: {reason}", markup=False, highlight=False)
    console.print(headline(found), markup=False, highlight=False)
    console.print(f"wrote {config.out}", markup=False, highlight=False)


def gathered(config: RobustnessConfig) -> tuple[list[PlayedArm], list[str]]:
    """Return who is tried, and warnings; FbidError for nobody, or for what is not valid."""
    further: dict[str, Any] = parse_env_args(config.env_args)
    for name, option in _OTHERWISE.items():
        if name in further:
            raise InvalidValueError(f"{name} in --env-args", further[name], f"none; see {option}")
    robot = chosen(config.robot, config.feet, config.robots)
    further |= {"episode_seconds": config.seconds}
    further |= {"robots": list(config.robots)} if config.robots else {}
    arms, warnings = load_arms(config.runs, config.env, config.arms, robot, further)
    env_id, env_args = config.env, {}
    if arms:
        first = arms[0].players[0]
        env_id, robot = first.env_id, first.robot
        env_args = {k: v for k, v in first.env_args.items() if k not in LAYER_ARGS}
        if config.env not in (None, env_id):
            raise InvalidValueError("--env", config.env, f"that of the runs, {env_id}, or none")
    if config.zero_action and env_id is None:
        raise InvalidValueError("--env", None, "an environment id, with --zero-action")
    if not arms and not config.zero_action:
        expected = "run folders, exported policies or studies; or --zero-action with --env"
        raise InvalidValueError("runs", [], expected)
    arms += [
        zero_action(str(env_id), layer, {**env_args, **further}, robot)
        for layer in dict.fromkeys(config.zero_action)
    ]
    return arms, warnings


main = partial(run_command, "eval.robustness", RobustnessConfig, run, about=__doc__, told=True)


if __name__ == "__main__":
    sys.exit(main())
