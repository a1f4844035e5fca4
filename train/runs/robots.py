"""Robots of users in run folders: which one a run is of, so that none is played on another unsaid.

In `config.json` and in a policy a built-in robot is its name, another one its name and digest; the
run folder keeps that as `robot.zip`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fbid_gym.errors import InvalidValueError, RunError
from fbid_gym.policy import Policy
from fbid_gym.robots import ROBOTS, ZOO, Robot, load
from fbid_gym.robots.description import feet_in_words
from fbid_gym.robots.several import check_word, each_name
from fbid_gym.robots.source import is_published
from fbid_gym.robots.zoo import HELD_OUT, is_held_out
from train.runs.archive import found
from train.runs.config import TrainConfig
from train.runs.files import read_json
from train.runs.folder import RunFolder


def chosen(robot: str | None, feet: Sequence[str] = (), robots: Sequence[str] = ()) -> Robot | None:
    """Return the robot that a command line names; None where it names none.

    Args:
        robot: the name of a built-in robot or of a drawn one, or an argument of `Robot.load`.
        feet: the words of `--feet`.
        robots: those of `--robots`, which say that there are several instead.

    Raises:
        FbidError: no such robot, one that cannot be used, or one beside several.
    """
    if robot is not None and robots:
        raise InvalidValueError("--robots", " ".join(robots), "none beside --robot")
    if robot is None:
        if feet:
            raise InvalidValueError("--feet", " ".join(feet), "none without --robot")
        return None
    if robot in ROBOTS or robot.startswith(ZOO):
        if feet:
            raise InvalidValueError("--feet", " ".join(feet), f"none for {robot!r}, which has its")
        return load(robot)
    if not is_published(robot):
        robot = str(found(Path(robot)))
        check_word(robot)
    return Robot.load(robot, feet_in_words(feet)).portable()


def named(robot: Robot) -> str | dict[str, str]:
    """Return the name of a robot in `config.json` and policies."""
    if is_built_in(robot):
        return robot.name
    return {"name": robot.name, "sha256": robot.digest}


def with_robot(config: TrainConfig, robot: Robot) -> TrainConfig:
    """Return the configuration with the robot named among the environment's arguments."""
    names = {**config.env_args, "robot": named(robot)}
    return replace(config, env_args=names, robot=None, feet=())


def with_robots(config: TrainConfig) -> TrainConfig:
    """Return the configuration with its list of robots among the environment's arguments."""
    if not config.robots:
        return config
    names = {**config.env_args, "robots": list(config.robots)}
    return replace(config, env_args=names, robots=())


def check_trainable(names: Sequence[str]) -> None:
    """Raise InvalidValueError for the name of a drawn robot that is for tests."""
    for name in names:
        if is_held_out(name):
            expected = f"seeds below {HELD_OUT}; the others are for tests"
            raise InvalidValueError("robot to train on", name, expected)


def is_built_in(robot: Robot) -> bool:
    """Whether its name says all of it."""
    known = robot.name in ROBOTS or robot.name.startswith(ZOO)
    return known and load(robot.name) is robot


def of_policy(path: Path, env_args: Mapping[str, Any], given: Robot | None = None) -> Robot | None:
    """Return the robot that a policy shall act on; None for the one that its arguments name.

    Args:
        path: its run folder, or its file.
        env_args: arguments that it was trained with.
        given: a robot that shall be played on instead.

    Raises:
        RunError: it was trained on a robot that is neither built in nor kept beside it.
    """
    its = env_args.get("robot")
    if given is not None or not isinstance(its, Mapping):
        return given
    for file in (RunFolder.of(folder).robot for folder in (path, path.parent)):
        if file.is_file():
            robot = Robot.load(file)
            if robot.digest == its.get("sha256"):
                return robot
            raise RunError(
                f"{file}: holds {_words(named(robot))}. Expected the robot of the policy, "
                f"{_words(its)}."
            )
    raise RunError(
        f"{path}: the policy was trained on {_words(its)}, which is not beside it. Give it with "
        "--robot."
    )


def learnt_with(path: Path) -> tuple[str, ...]:
    """Return the names of the robots that a policy learnt with, where these were several.

    Args:
        path: its run folder, or the file of one that is shipped.
    """
    config = RunFolder.of(path).config
    if config.is_file():
        return each_name((read_json(config).get("env_args") or {}).get("robots") or ())
    card = Policy.load(path).card if path.is_file() else None
    return () if card is None else card.robots


def another(path: Path, env_args: Mapping[str, Any], robot: Robot | None) -> str | None:
    """Say in a sentence that a policy is played on another robot than it was trained on, or None.

    The arguments are those that it is played with, the robot as `of_policy` gives it.
    """
    several, its = learnt_with(path), env_args.get("robot")
    on = each_name(env_args.get("robots", ()))
    known = {robot.name} if robot is not None else set(on)
    if known <= set(several) or (robot is not None and not several and its == named(robot)):
        return None
    trained = f"{len(several)} robots" if several else _words(its)
    where = f"robots {', '.join(on)}" if robot is None else _words(named(robot))
    return f"{path.name} was trained on {trained} and is played on {where}."


def _words(robot: Any) -> str:
    if robot is None:
        return "the robot of its environment"
    if isinstance(robot, Mapping):
        return f"robot {robot.get('name')!r} ({str(robot.get('sha256'))[:12]}…)"
    return f"robot {robot!r}"
