"""Arms of a robustness test: runs grouped as in `eval.compare`, studies' arms, zero actions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from eval.comparable import check_comparable, group
from eval.rollout import Player
from fbid_gym.checks import check_choices
from fbid_gym.envs.vector_env import RobotVectorEnv
from fbid_gym.errors import InvalidValueError, RunError
from fbid_gym.robots import Robot
from fbid_gym.runtime.config import EnvConfig
from train.environments import first_alone, make_envs
from train.runs.proportional import ZERO
from train.runs.reading import layer_name, load
from train.runs.study import Cell, arms, check_cells, read_study


@dataclass(frozen=True)
class PlayedArm:
    """Runs that differ in their seed alone, or the zero action of a layer."""

    name: str
    layer: str  # its action layer with its options, in words
    players: tuple[Player, ...]  # one for each run
    runs: tuple[str, ...] = ()
    """Names of the runs, or of what a study has instead of one; none for a zero action."""


def load_arms(
    paths: Sequence[Path],
    env_id: str | None,
    named: Sequence[str],
    robot: Robot | None,
    env_args: Mapping[str, Any],
) -> tuple[list[PlayedArm], list[str]]:
    """Load run folders and exported policies, an arm a layer; and studies, with their own arms.

    Of studies, which are `.toml`, runs in this environment and arms of these names alone, if any
    are given. Robot and arguments replace those of the training. Warnings come with the arms.

    Raises:
        RunError: one of them cannot be read or is not finished, or nothing of a study is; or runs
            that cannot be compared.
        UnknownOptionError: no study has an arm of that name.
    """
    studies = [(path, read_study(path)) for path in paths if path.suffix == ".toml"]
    several = env_args.get("robots", ())
    runs = [load(path, robot, several) for path in paths if path.suffix != ".toml"]
    warnings = check_comparable(runs) if runs else []
    found = [
        PlayedArm(
            *(name, name, tuple(Player.of(run, **env_args) for run in its)),
            tuple(run.path.name for run in its),
        )
        for name, its in group(runs).items()
    ]
    known = dict.fromkeys(arm.name for _, study in studies for arm in arms(study))
    check_choices("arm", named, known or ("none: there is no study",))
    for path, study in studies:
        check_cells(study)
        its = [
            (arm, arm.finished())
            for arm in arms(study)
            if env_id in (None, arm.env) and (not named or arm.name in named)
        ]
        if not any(done for _, done in its):
            where = f" in {env_id}" if env_id else ""
            raise RunError(
                f"{path}: no run of the study has finished{where}: python -m train.sweep."
            )
        found += [arm_of_cells(arm.name, done, robot, env_args) for arm, done in its if done]
        warnings += [
            f"{cell.name} of {path.name} has not finished and is left out."
            for arm, done in its
            for cell in arm.cells
            if cell not in done
        ]
    _check_arms(found)
    return found, warnings


def arm_of_cells(
    name: str, cells: Sequence[Cell], robot: Robot | None, env_args: Mapping[str, Any]
) -> PlayedArm:
    """Return finished cells of a study as its arm; other arguments as for `load_arms`."""
    players = tuple(Player.of_cell(cell, robot, **env_args) for cell in cells)
    layer = layer_name(cells[0].config.make_args())
    return PlayedArm(name, layer, players, tuple(cell.config.folder.name for cell in cells))


def _check_arms(found: Sequence[PlayedArm]) -> None:
    """Raise RunError unless arms are told apart by their names, and all are in one environment."""
    names = [arm.name for arm in found]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise RunError(f"There are two arms {twice[0]!r}. Expected each name once.")
    ids = sorted({player.env_id for arm in found for player in arm.players})
    if len(ids) > 1:
        raise RunError(f"The runs are of {', '.join(ids)}. Expected one environment: see --env.")


def zero_action(
    env_id: str, layer: str, env_args: Mapping[str, Any], robot: Robot | None = None
) -> PlayedArm:
    """Return the zero action of a layer as an arm; a robot replaces the one of the arguments."""
    player = Player.unlearnt(ZERO, env_id, {**env_args, "action_layer": layer}, robot)
    words = layer_name(player.env_args)
    name = f"{words}, zero action"
    return PlayedArm(name, words, (replace(player, name=name),))


def environment(player: Player) -> EnvConfig:
    """Return the environment of a player, which can play in it.

    Raises:
        UnknownOptionError: there is no such environment.
        InvalidValueError: it is none of ours, or has arguments that are not valid.
        PolicyFileError: the policy does not fit it.
    """
    envs = make_envs(player.env_id, first_alone(player.make_args), 1)
    try:
        if not isinstance(envs, RobotVectorEnv):
            expected = "one whose robots and arguments are those of fbid_gym"
            raise InvalidValueError("environment", player.env_id, expected)
        player.actor(envs.single_observation_space, envs.single_action_space)
        return envs.config
    finally:
        envs.close()
