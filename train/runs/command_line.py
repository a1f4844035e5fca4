"""The command line of a training run: read with the recipe of its environment, and written."""

import argparse
import io
import json
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import redirect_stderr
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, TypeVar

import tyro

from fbid_gym.__main__ import called
from fbid_gym.errors import FbidError, InvalidValueError
from train.recipes import NONE, config_for, recipes
from train.runs.config import ALGORITHMS, TrainConfig, algorithm_of, completed, parse_object
from train.runs.folder import RunFolder
from train.runs.reading import LAYER_ARGS

Read = TypeVar("Read")


def parse(arguments: Sequence[str] | None = None, algorithm: str = "ppo") -> TrainConfig:
    """Read the command line; other settings are those of the environment's recipe.

    Args:
        arguments: without the program name; None for those of this process.
        algorithm: whose program it is.

    Raises:
        FbidError: no such recipe, or a recipe or value that is not valid.
    """
    given = sys.argv[1:] if arguments is None else list(arguments)
    others = tuple(f"--{name}." for name in ALGORITHMS if name != algorithm)
    for word in given:
        if word.startswith(others):
            raise InvalidValueError("option", word, f"those of train.{algorithm}")
    chosen, rest = _chosen(given)
    usual = config_for(
        chosen.env, chosen.action_layer, chosen.layer_options, chosen.recipe, algorithm=algorithm
    )
    names = ", ".join([*recipes(), NONE])
    return read_options(
        TrainConfig,
        prog=" ".join(called(f"train.{algorithm}")),
        description=f"{TrainConfig.__doc__}\n\nDefaults are those of the environment's recipe in "
        f"train/recipes; --recipe NAME takes those of another: {names}.",
        default=_plain(usual),
        args=rest,
    )


def read_options(options: Callable[..., Read], **how: Any) -> Read:
    """Return what `tyro.cli` reads of a command line; errors of ours stay what they are.

    Of those that are ValueErrors tyro would make a page.
    """
    said = io.StringIO()
    try:
        with redirect_stderr(said):
            return tyro.cli(options, **how)
    except SystemExit as ended:
        cause: BaseException | None = ended
        while cause is not None and not isinstance(cause, FbidError):
            cause = cause.__context__
        if cause is not None:
            raise cause from None
        sys.stderr.write(said.getvalue())
        raise


def options(config: TrainConfig) -> tuple[str, ...]:
    """Return the command line that `parse` reads as this configuration, for its algorithm."""
    usual = config_for(
        config.env, config.action_layer, config.layer_options, algorithm=config.algorithm
    )
    return tuple(_options(asdict(config), asdict(_plain(usual))))


def command(config: TrainConfig) -> str:
    """Return the whole command that trains a configuration, in its own folder."""
    own = replace(config, num_threads=TrainConfig.num_threads)
    return shlex.join([*called(f"train.{config.algorithm}"), *options(own)])


def stored_options(stored: Mapping[str, Any], folder: RunFolder) -> tuple[str, ...]:
    """Return the command line that repeats the training of a `config.json`, in the usual folder.

    It is that of the algorithm's own program.

    Args:
        stored: as `TrainConfig.to_json` gives it, of this version of the package or another.
        folder: where it is; holds the robot, if that is none of the built-in ones.
    """
    env = stored["env_id"]
    layer, layer_options = stored.get("action_layer", ""), stored.get("layer_options", {})
    learns = algorithm_of(stored)
    usual = _plain(config_for(env, layer, layer_options, algorithm=learns)).to_json()
    # Numbers of threads and checkpoints are no part of the training.
    for name in ("num_threads", "torch_threads", "checkpoint_every", "env_id", "algorithm"):
        del usual[name]
    # Layer options are twice in the JSON, for readers of these arguments alone.
    arguments = {k: v for k, v in stored.get("env_args", {}).items() if k not in LAYER_ARGS}
    usual |= {"env": TrainConfig.env, "env_args": {}, "robot": None, "robots": []}
    robot = arguments.get("robot")
    if isinstance(robot, Mapping):
        robot = str(folder.robot)
    arguments.pop("robot", None)
    own = {"robot": robot, "robots": arguments.pop("robots", [])}
    again = {**completed(stored), "env": env, "env_args": arguments, **own}
    return tuple(_options(again, usual))


def command_again(stored: Mapping[str, Any], path: Path) -> str:
    """Return the whole command that repeats the training of the `config.json` in a folder."""
    options = stored_options(stored, RunFolder.to_write(path))
    return shlex.join([*called(f"train.{algorithm_of(stored)}"), *options])


def _chosen(given: list[str]) -> tuple[argparse.Namespace, list[str]]:
    """Return the settings that choose the recipe, and the command line without its name."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    parser.add_argument("--env", default=TrainConfig.env)
    parser.add_argument("--action-layer", "--action_layer", default=TrainConfig.action_layer)
    parser.add_argument("--layer-options", "--layer_options", default="{}")
    parser.add_argument("--recipe")
    try:
        chosen, _ = parser.parse_known_args(given)
        chosen.layer_options = parse_object(chosen.layer_options)
    except (argparse.ArgumentError, ValueError):
        # The full command line has the better error message.
        return parser.parse_args([], argparse.Namespace(layer_options={})), given
    only = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    only.add_argument("--recipe")
    return chosen, only.parse_known_args(given)[1]


def _plain(config: TrainConfig) -> TrainConfig:
    """Return the recipe's changes, on the environment and layer of no recipe."""
    return replace(
        config, env=TrainConfig.env, action_layer=TrainConfig.action_layer, layer_options={}
    )


def _options(data: Mapping[str, Any], usual: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """Yield the entries that differ from the defaults."""
    for name, value in data.items():
        if name in (*ALGORITHMS, "eval") and value is not None:
            yield from _options(value, usual[name], f"{name}.")
        elif name in usual and name != "algorithm" and value != usual[name]:
            yield f"--{prefix}{'no-' if value is False else ''}{name.replace('_', '-')}"
            if isinstance(value, dict):
                yield json.dumps(value)
            elif isinstance(value, tuple | list):
                yield from map(str, value)
            elif not isinstance(value, bool):
                yield str(value)
