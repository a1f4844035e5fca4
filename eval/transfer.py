r"""Play policies, unchanged, on robots that they may never have seen, beside the zero action.

python -m eval.transfer runs/my_run --robots go1 zoo:quadruped:1000-1029 --gain 4 --out transfer.csv
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
import tyro
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from eval.rollout import Player, lawful, load_player, play_player
from eval.statistics import signed_rank
from fbid_gym.bundles import SUFFIX
from fbid_gym.errors import FbidError, InvalidValueError
from fbid_gym.options import Choice, Whole
from fbid_gym.policy import place_of
from fbid_gym.robots import Robot, several
from train.command import run_command
from train.environments import parse_env_args
from train.episodes import Episodes
from train.progress import progress
from train.runs.environment import load_policy
from train.runs.files import check_output, write
from train.runs.proportional import GAIN, LAW, PREFIX
from train.runs.tables import to_csv

ROBOT = ("robot", "mass", "joints", "feet")
COLUMNS = (*ROBOT, "policy", "episodes", "return", "up", "velocity_error")
ZERO = "zero, "  # what the name of a zero action begins with, before its layer

Who = Literal["all", "policies", "laws"]


@dataclass(frozen=True)
class TransferConfig:
    """Play policies, unchanged, on robots that they may never have seen."""

    sources: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Run folders, exported policies or `shipped:NAME`."""
    robots: tuple[str, ...]
    """Built-in robots, paths of files, "menagerie:NAME", or "zoo:quadruped:1000-1029"."""
    who: Annotated[Who, Choice(get_args(Who))] = "all"
    """Who plays: the policies, what learnt nothing in their environments, or all of them."""
    gain: Annotated[float, GAIN] | None = None
    """Let the proportional law of this gain play as well, through the policies' layers: 1/s, with
    observation="body" sqrt(g / h)."""
    episodes: Annotated[int, Whole(1, 100_000)] = 8
    """On each robot."""
    seed: Annotated[int, Whole(0, 2**63)] = 50_000
    """Environment i starts from seed + i."""
    env_args: str = "{}"
    """Further environment arguments as a JSON object; they replace those of the policies."""
    out: Path | None = None
    """Write the table, as .csv."""


def run(config: TransferConfig) -> None:
    """Do what the command line asks."""
    console = Console()
    check_output(config.out, "out", (".csv",))
    if not config.sources:
        raise InvalidValueError("sources", "()", "at least one policy")
    robots, env_args = several(config.robots), parse_env_args(config.env_args)
    for source in config.sources:
        load_policy(place_of(source))  # a path that is none is said at once
    rows, labels = list[dict[str, Any]](), distinct([robot.name for robot in robots])
    with progress(console, "robots") as tell:
        for k, (robot, label) in enumerate(zip(robots, labels, strict=True)):
            for name, source, change in _players(config, env_args):
                played = None
                try:
                    player = change(load_player(source, env_args, robot))
                    played = play_player(player, config.episodes, config.seed)
                except FbidError as reason:  # it cannot act on the robot
                    sentence = f"{name} on {label}: {reason}"
                    console.print(sentence, markup=False, highlight=False, soft_wrap=True)
                rows.append(_row(robot, label, name, played))
            tell(k + 1, len(robots), label)
    console.print(table(rows))
    for sentence in findings(rows):
        console.print(sentence, markup=False, highlight=False, soft_wrap=True)
    if config.out is not None:
        write(config.out, to_csv(list(COLUMNS), rows))
        console.print(f"wrote {config.out}", markup=False, highlight=False)


def _players(
    config: TransferConfig, env_args: dict[str, Any]
) -> Iterator[tuple[str, Path, Callable[[Player], Player]]]:
    """Names of those who play, and what makes them of a policy: itself, then what learnt nothing.

    The latter once for each layer.
    """
    told = set[str]()
    for source in config.sources:
        its = load_policy(place_of(source))
        layer = {**its.env_args, **env_args}.get("action_layer", "")
        if config.who != "laws":
            named = f"{its.source}, {layer}" if its.algorithm == LAW else ""
            yield named or source.name.removesuffix(SUFFIX), source, lambda player: player
        if config.who == "policies" or layer in told:
            continue
        told.add(layer)
        yield f"{ZERO}{layer}", source, lambda player: replace(player, policy=None)
        if config.gain is not None:
            name = f"{PREFIX}{config.gain:g}, {layer}"
            yield name, source, partial(lawful, gain=config.gain)


def distinct(names: Sequence[str]) -> list[str]:
    """Number the names that several have: files of different robots may give the same."""
    return [
        f"{name} ({names[: k + 1].count(name)})" if names.count(name) > 1 else name
        for k, name in enumerate(names)
    ]


def _row(robot: Robot, label: str, name: str, played: Episodes | None) -> dict[str, Any]:
    own = {"robot": label, "mass": f"{robot.mass:.4g}", "joints": robot.num_joints}
    row: dict[str, Any] = {**own, "feet": robot.num_feet, "policy": name}
    if played is None:
        return row | {"return": "", "up": "", "velocity_error": "", "episodes": 0}
    up, error = np.mean(played.survived), np.mean(played.velocity_error)
    told = {"return": f"{np.mean(played.returned):.6g}", "up": f"{up:.4g}"}
    return row | told | {"velocity_error": f"{error:.4g}", "episodes": len(played)}


def table(rows: list[dict[str, Any]]) -> Table:
    """Return and share of the episodes without a fall, a row for each robot."""
    result = Table(title="Return, and share of the episodes without a fall", title_justify="left")
    result.add_column("robot", no_wrap=True)
    for heading in ("kg", "joints"):
        result.add_column(heading)
    policies = list(dict.fromkeys(row["policy"] for row in rows))
    for policy in policies:
        result.add_column(escape(policy), justify="right", overflow="fold")
    by_robot = dict[str, dict[str, dict[str, Any]]]()
    for row in rows:
        by_robot.setdefault(row["robot"], {})[row["policy"]] = row
    for robot, own in by_robot.items():
        first = next(iter(own.values()))
        cells = [
            f"{float(own[p]['return']):.0f}, {100 * float(own[p]['up']):.0f} %"
            if p in own and own[p]["episodes"]
            else "cannot act"
            for p in policies
        ]
        result.add_row(escape(robot), first["mass"], str(first["joints"]), *cells)
    return result


def findings(rows: list[dict[str, Any]]) -> list[str]:
    """Say how many stay up, and on how many robots a policy earns more than what learnt nothing.

    p is that of Wilcoxon's signed-rank test over the robots.
    """
    earned = dict[str, dict[str, float]]()
    up = dict[str, list[float]]()
    for row in rows:
        if row["episodes"]:
            earned.setdefault(row["policy"], {})[row["robot"]] = float(row["return"])
            up.setdefault(row["policy"], []).append(float(row["up"]))
    found = [
        f"{policy}: a return of {np.mean(list(earned[policy].values())):.1f}, "
        f"{100 * np.mean(shares):.1f} % of the episodes without a fall, on {len(shares)} robots."
        for policy, shares in up.items()
    ]
    for one in earned:
        for other in earned:
            both = [robot for robot in earned[one] if robot in earned[other]]
            if other.startswith((ZERO, PREFIX)) and not one.startswith((other, ZERO)) and both:
                more = np.array([earned[one][robot] - earned[other][robot] for robot in both])
                found.append(
                    f"{one} earns more than {other} on {(more > 0.0).sum()} of {len(both)} robots "
                    f"(p = {signed_rank(more):.2g})."
                )
    return found


main = partial(run_command, "eval.transfer", TransferConfig, run, about=__doc__)


if __name__ == "__main__":
    sys.exit(main())
