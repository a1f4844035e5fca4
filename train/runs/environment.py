"""Meaning of the arguments of a run's environment: defaults may change after a run began."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from fbid_gym.envs.registered import resolved_arguments
from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy
from fbid_gym.robots import Robot
from train.runs.archive import found
from train.runs.differences import environment_differences, in_words
from train.runs.files import read_json
from train.runs.folder import RunFolder
from train.runs.proportional import named
from train.runs.robots import of_policy

_BEFORE = {"pendulum": False, "velocity_of": "com", "leg_weight": False}
"""Options of layers that are younger than some policies, as layers were before them."""


def meaning(config: Mapping[str, Any], robot: Robot | None = None) -> dict[str, Any] | None:
    """Return today's meaning of the environment's arguments in a `config.json`.

    With a robot, of this one instead of the one that they name; as `environment.json` holds it.
    None where the environment is not one of ours.

    Raises:
        FbidError: they are not valid today.
    """
    arguments = dict(config.get("env_args") or {})
    if robot is not None:
        arguments["robot"] = robot
    return resolved_arguments(str(config.get("env_id")), arguments)


def _trained(path: Path) -> tuple[Mapping[str, Any], Mapping[str, Any]] | None:
    """Return the environment of a policy's training, from `config.json` and `environment.json`.

    They are read in the folder of a run or on the card of a policy; None where there is neither.
    """
    folder = RunFolder.of(path)
    if path.is_file() and (policy := Policy.load(path)).card is not None:
        return {"env_id": policy.env_id, "env_args": policy.env_args}, policy.card.environment
    if folder.environment.is_file() and folder.config.is_file():
        return read_json(folder.config), read_json(folder.environment)
    return None


def as_trained(path: Path, env_args: Mapping[str, Any]) -> dict[str, Any]:
    """Return a policy's arguments with the options of its layer that it was trained with.

    Args:
        path: folder of its run, or its file.
        env_args: as the policy has them.

    Returns:
        The arguments, with what their layer's options meant where they mean something else today.

    Raises:
        RunError: a file of the run that is not JSON.
        PolicyFileError: the policy cannot be read.
    """
    trained, arguments = _trained(path), dict(env_args)
    if trained is None:
        return arguments
    config, stored = trained
    try:
        today = _today(path, config).get("layer_options", {})
    except FbidError:  # of an environment that cannot be made; whoever makes it is told
        return arguments
    was = _BEFORE | (stored.get("layer_options") or {})
    changed = {name: was[name] for name in was.keys() & today.keys() if was[name] != today[name]}
    if changed:
        arguments["layer_options"] = changed | (arguments.get("layer_options") or {})
    return arguments


def load_policy(path: Path) -> Policy:
    """Load a policy, to be played as it was trained.

    Args:
        path: of a run folder, a shipped policy, or an exported one, which does not say what its
            arguments meant; or the name of a proportional law.

    Raises:
        RunError: a file of the run that is not JSON.
        PolicyFileError: the policy cannot be read.
    """
    policy = named(path) or Policy.load(found(path))
    return replace(policy, env_args=as_trained(path, policy.env_args))


def changed_meaning(path: Path) -> str | None:
    """Compare the meaning of a run's arguments when it began with their meaning today.

    Args:
        path: folder of a run, or file of a shipped policy. Another exported policy and a run of
            another environment do not say what their arguments meant.

    Returns:
        One sentence that names what differs; None where nothing does or nothing is known.

    Raises:
        RunError: a file of the run that is not JSON.
        PolicyFileError: the policy cannot be read.
    """
    trained = _trained(path)
    if trained is None:
        return None
    config, stored = trained
    try:
        arguments = as_trained(path, config.get("env_args") or {})
        today = _today(path, {**config, "env_args": arguments})
    except FbidError as error:
        return f"{path.name} was trained in an environment that is not valid today: {error}"
    different = environment_differences(stored, today)
    if not different:
        return None
    return (
        f"{path.name} was trained in another environment than its arguments make today: "
        f"{in_words(different)}."
    )


def _today(path: Path, config: Mapping[str, Any]) -> dict[str, Any]:
    return meaning(config, of_policy(path, config.get("env_args") or {})) or {}
