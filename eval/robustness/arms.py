"""Who is tried: runs grouped by their action layer as `eval.compare` does, and zero actions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eval.comparable import check_comparable, group
from eval.rollout import Player
from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.vector_env import RobotVectorEnv
from fbid_gym.errors import InvalidValueError, RunError
from fbid_gym.robots import Robot
from train.environments import make_envs
from train.runs.reading import Run, layer_name, load
from train.runs.robots import named
from train.runs.study import read_study
from train.runs.training import is_finished


@dataclass(frozen=True)
class Arm:
    """Runs that differ in their seed alone, or the zero action of a layer."""

    name: str
    layer: str
    """Its action layer with its options, in words."""
    players: tuple[Player, ...]
    """One for each run."""
    runs: tuple[str, ...] = ()
    """Names of the runs; none for a zero action."""


def load_runs(
    paths: Sequence[Path], env_id: str | None, robot: Robot | None
) -> tuple[list[Run], list[str]]:
    """Load run folders, exported policies, and the finished runs of studies.

    Args:
        paths: folders; a file is a study.
        env_id: of a study, only its runs in this environment.
        robot: to be played on instead of the one that they were trained on.

    Returns:
        The runs; and warnings, one sentence each.

    Raises:
        RunError: one of them cannot be read or is not finished, or nothing of a study is.
    """
    runs: list[Run] = []
    warnings: list[str] = []
    for path in paths:
        if not path.is_file():
            runs.append(load(path, robot))
            continue
        cells = [
            cell for cell in read_study(path).cells if env_id is None or cell.config.env == env_id
        ]
        finished = [cell for cell in cells if is_finished(cell.config)]
        if not finished:
            where = f" in {env_id}" if env_id else ""
            raise RunError(
                f"{path}: no run of the study has finished{where}: python -m train.sweep."
            )
        runs += [load(cell.config.folder, robot) for cell in finished]
        warnings += [
            f"{cell.name} of {path.name} has not finished and is left out."
            for cell in cells
            if cell not in finished
        ]
    return runs, warnings


def arms_of_runs(runs: Sequence[Run], env_args: Mapping[str, Any]) -> tuple[list[Arm], list[str]]:
    """Group runs as `eval.compare` does.

    Args:
        runs: what was trained.
        env_args: replace those that they were trained with.

    Returns:
        The arms; and warnings, one sentence each.

    Raises:
        RunError: runs that cannot be compared.
    """
    if not runs:
        return [], []
    warnings = check_comparable(runs)
    arms = [
        Arm(
            name,
            name,
            tuple(Player.of(run, **env_args) for run in members),
            tuple(run.path.name for run in members),
        )
        for name, members in group(runs).items()
    ]
    return arms, warnings


def zero_action(
    env_id: str, layer: str, env_args: Mapping[str, Any], robot: Robot | None = None
) -> Arm:
    """Return the zero action of a layer as an arm.

    Args:
        env_id: Gymnasium id.
        layer: action layer.
        env_args: further arguments of the environment; `robot` among them only by its name.
        robot: to be played on instead of the one that they name.
    """
    arguments = {**env_args, "action_layer": layer}
    if robot is not None:
        arguments["robot"] = named(robot)
    words = layer_name(arguments)
    player = Player(f"{words}, zero action", env_id, arguments, None, robot)
    return Arm(player.name, words, (player,))


def environment(player: Player) -> EnvConfig:
    """Return the environment of a player, which can play in it.

    Raises:
        UnknownOptionError: there is no such environment.
        InvalidValueError: it is none of ours, or has arguments that are not valid.
        PolicyFileError: the policy does not fit it.
    """
    envs = make_envs(player.env_id, player.make_args, 1)
    try:
        if not isinstance(envs, RobotVectorEnv):
            expected = "one whose robots and arguments are those of fbid_gym"
            raise InvalidValueError("environment", player.env_id, expected)
        player.actor(envs.single_observation_space, envs.single_action_space)
        return envs.config
    finally:
        envs.close()
