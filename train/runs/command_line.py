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
from fbid_gym.policy import place_of
from train.recipes import NONE, config_for, recipes
from train.runs.config import ALGORITHMS, TrainConfig, algorithm_of, completed, parse_object
from train.runs.environment import load_policy
from train.runs.folder import RunFolder
from train.runs.reading import LAYER_ARGS

_NETWORK = dict.fromkeys(("hidden", "activation"))

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
    if "--robots" in given and ([*given, "--"][given.index("--robots") + 1]).startswith("--"):
        raise InvalidValueError("--robots", "()", "at least one robot")
    begun, network = _begun(chosen.start)
    env, layer, layer_options = (getattr(chosen, x) or begun[x] for x in ("env", *LAYER_ARGS))
    usual = config_for(env, layer, layer_options, chosen.recipe, algorithm=algorithm)
    begun[algorithm] = replace(usual.hyperparameters, **network)
    names = ", ".join([*recipes(), NONE])
    return read_options(
        TrainConfig,
        prog=" ".join(called(f"train.{algorithm}")),
        description=f"{TrainConfig.__doc__}\n\nDefaults are those of the environment's recipe in "
        f"train/recipes and of the policy to --start with; --recipe NAME takes those of another: "
        f"{names}.",
        default=replace(usual, **begun),
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
    return tuple(_options(asdict(config), _unsaid(asdict(_plain(usual)), config.start)))


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
    return tuple(_options(again, _unsaid(usual, again["start"])))


def command_again(stored: Mapping[str, Any], path: Path) -> str:
    """Return the whole command that repeats the training of the `config.json` in a folder."""
    options = stored_options(stored, RunFolder.to_write(path))
    return shlex.join([*called(f"train.{algorithm_of(stored)}"), *options])


def _chosen(given: list[str]) -> tuple[argparse.Namespace, list[str]]:
    """Return the settings that choose the recipe, and the command line without its name."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    for name in ("--env", "--start", "--recipe"):
        parser.add_argument(name)
    parser.add_argument("--action-layer", "--action_layer")
    parser.add_argument("--layer-options", "--layer_options", default="{}")
    try:
        chosen, _ = parser.parse_known_args(given)
        chosen.layer_options = parse_object(chosen.layer_options)
    except (argparse.ArgumentError, ValueError):
        # The full command line has the better error message.
        return parser.parse_args([], argparse.Namespace(layer_options={})), given
    only = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    only.add_argument("--recipe")
    return chosen, only.parse_known_args(given)[1]


def _begun(start: str | None) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return settings of a training that begins with a policy, or with none; and of its network.

    They are those of the policy, but for the robot.
    """
    if start is None:
        args: Mapping[str, Any] = {"action_layer": TrainConfig.action_layer}
        env, network = TrainConfig.env, {}
    else:
        policy = load_policy(place_of(start))
        args, env = policy.env_args, policy.env_id
        widths = tuple(len(bias) for bias in policy.biases[:-1])
        network = {"hidden": widths, "activation": policy.activation}
    rest = {name: value for name, value in args.items() if name not in ("robot", *LAYER_ARGS)}
    layer = {name: args.get(name, {}) for name in LAYER_ARGS}
    return {"start": start, "env": env, "env_args": rest, **layer}, network


def _unsaid(usual: dict[str, Any], start: str | None) -> dict[str, Any]:
    """Return defaults without those that a policy to start with would replace."""
    if start is None:
        return usual
    own = {name: {**usual[name], **_NETWORK} for name in ALGORITHMS if usual.get(name)}
    return {**usual, **dict.fromkeys(("env", "env_args", *LAYER_ARGS)), **own}


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
