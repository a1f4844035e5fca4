"""Run folders as the comparison sees them, and whether they may be compared at all."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eval.environment import changed_meaning, differing_fields, in_words
from eval.files import read_json
from eval.rollout import Player
from fbid_gym.errors import RunError
from fbid_gym.policy import Policy
from train.config import flat

_LAYER_ARGS = ("action_layer", "layer_options")


@dataclass(frozen=True)
class Curve:
    """Periodic evaluations of one run, (K,) each."""

    steps: np.ndarray
    """Environment steps of all robots together."""
    wall_seconds: np.ndarray
    """Time since training began, s."""
    returns: np.ndarray
    """Mean return."""
    episodes: np.ndarray
    """Number of episodes it is the mean of."""


@dataclass(frozen=True)
class Run:
    """A trained run, or only its exported policy."""

    path: Path
    layer: str
    """Action layer with its options, in words; runs of one layer form a group."""
    seed: int | None
    """None for an exported policy, which does not know it."""
    policy: Policy
    config: dict[str, Any] | None
    """As resolved by the training script; None for an exported policy."""
    versions: dict[str, Any]
    """Of Python and packages, the commit and the platform, as far as they are known."""
    curve: Curve | None
    """None for an exported policy."""

    @property
    def env_args(self) -> dict[str, Any]:
        """Arguments of the environment other than the layer."""
        return {k: v for k, v in self.policy.env_args.items() if k not in _LAYER_ARGS}

    def player(self, trained: bool = True, **env_args: Any) -> Player:
        """Make the player of this run, or of the zero action in its environment."""
        arguments = {**self.policy.env_args, **env_args}
        return Player(self.layer, self.policy.env_id, arguments, self.policy if trained else None)


def load(path: Path) -> Run:
    """Load a run folder, or the folder of an exported policy.

    Raises:
        RunError: the folder or a file in it is missing, unreadable or incomplete.
        PolicyFileError: the policy is, or the folder is neither.
    """
    if not path.is_dir():
        raise RunError(f"{path}: no such folder. Expected a run folder or an exported policy.")
    if not (path / "config.json").is_file():
        policy = Policy.load(path)
        versions = dict(policy.versions)
        return Run(path, _layer_name(policy.env_args), None, policy, None, versions, None)
    for name in ("versions.json", "evaluations.csv"):
        if not (path / name).is_file():
            raise RunError(
                f"{path}: {name} is missing: the run has not got that far, or was not evaluated."
            )
    config = read_json(path / "config.json")
    for key in ("env_id", "seed", "total_steps"):
        if key not in config:
            raise RunError(f"{path / 'config.json'}: {key!r} is missing.")
    policy = Policy.load(path)
    if policy.env_id != config["env_id"]:
        raise RunError(
            f"{path}: config.json says {config['env_id']}, the policy in it was trained in "
            f"{policy.env_id}."
        )
    curve = _read_curve(path / "evaluations.csv")
    if curve.steps[-1] < config["total_steps"]:
        raise RunError(
            f"{path}: trained for {curve.steps[-1]:.0f} of {config['total_steps']} steps. "
            "Resume it, or leave it out."
        )
    return Run(
        path,
        _layer_name(policy.env_args),
        int(config["seed"]),
        policy,
        config,
        read_json(path / "versions.json"),
        curve,
    )


def group(runs: Sequence[Run]) -> dict[str, list[Run]]:
    """Runs by layer, in the order in which the layers were first named."""
    groups: dict[str, list[Run]] = {}
    for run in runs:
        groups.setdefault(run.layer, []).append(run)
    return groups


def check_comparable(runs: Sequence[Run]) -> list[str]:
    """Refuse what cannot be compared, and describe what differs though it should not.

    Another environment, or other arguments of it, changes what a return means: an error. Other
    training settings leave it comparable but make the layer one difference among several: a
    warning, and so is an environment whose arguments mean something else since it was trained in.

    Returns:
        Warnings, one sentence each.

    Raises:
        RunError: no runs, the same one twice, or different environments.
    """
    if not runs:
        raise RunError("Nothing to compare: no run was given.")
    first = runs[0]
    seen: dict[Path, Run] = {}
    for run in runs:
        if run.path.resolve() in seen:
            raise RunError(f"{run.path}: given twice. A run counts once.")
        seen[run.path.resolve()] = run
        if run.policy.env_id != first.policy.env_id:
            raise RunError(
                f"{run.path} was trained in {run.policy.env_id}, {first.path} in "
                f"{first.policy.env_id}. Compare runs of one environment at a time."
            )
        different = differing_fields(first.env_args, run.env_args)
        if different:
            raise RunError(
                f"{run.path} and {first.path} have different environment arguments, so a return "
                f"means different things: {in_words(first.env_args, run.env_args, different)}."
            )
    changed = (changed_meaning(run.path) for run in runs)
    return [warning for warning in changed if warning] + _training_warnings(runs)


def _training_warnings(runs: Sequence[Run]) -> list[str]:
    warnings = []
    trained = [run for run in runs if run.config is not None]
    for run in trained[1:]:
        reference = trained[0]
        one, other = (_settings(item.config or {}) for item in (reference, run))
        different = differing_fields(one, other)
        if different:
            warnings.append(
                f"{run.path.name} was not trained like {reference.path.name}: "
                f"{in_words(one, other, different)}. The layer is not the only difference."
            )
    for layer, members in group(trained).items():
        seeds = [run.seed for run in members]
        twice = sorted({seed for seed in seeds if seeds.count(seed) > 1 and seed is not None})
        if twice:
            warnings.append(
                f"{layer}: several runs have seed {', '.join(map(str, twice))}. They are "
                "counted as independent, which they are not."
            )
    platforms = {str(run.versions.get("platform")) for run in trained}
    commits = {str((run.versions.get("git") or {}).get("commit")) for run in trained}
    for values, what in ((platforms, "machines"), (commits, "versions of this project")):
        if len(values) > 1:
            warnings.append(f"The runs come from different {what}: {', '.join(sorted(values))}.")
    counts = {layer: len(members) for layer, members in group(runs).items()}
    if len(set(counts.values())) > 1:
        described = ", ".join(f"{layer} {count}" for layer, count in counts.items())
        warnings.append(f"The layers have different numbers of runs: {described}.")
    return warnings


def _settings(config: Mapping[str, Any]) -> dict[str, Any]:
    """Flatten what should be the same in every run of a comparison."""
    ignored = {"env_id", "env_args", "action_layer", "layer_options", "seed", "name", "out", "eval"}
    return flat({key: value for key, value in config.items() if key not in ignored})


def shared_settings(runs: Sequence[Run]) -> dict[str, Any]:
    """Training settings that all runs have in common, flattened to dotted names."""
    configs = [_settings(run.config) for run in runs if run.config is not None]
    if not configs:
        return {}
    return {
        key: value
        for key, value in configs[0].items()
        if all(key in config and config[key] == value for config in configs)
    }


def _layer_name(env_args: Mapping[str, Any]) -> str:
    name = str(env_args.get("action_layer", "default layer")).replace("_", " ")
    options = env_args.get("layer_options") or {}
    if not options:
        return name
    described = ", ".join(
        f"{key.replace('_', ' ')}: {value}" for key, value in sorted(options.items())
    )
    return f"{name} ({described})"


def _read_curve(path: Path) -> Curve:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        raise RunError(f"{path}: holds no evaluation, so there is no learning curve.")
    columns = []
    for name in ("steps", "wall_seconds", "return_mean", "episodes"):
        if name not in rows[0]:
            raise RunError(f"{path}: column {name!r} is missing.")
        try:
            columns.append(np.array([float(row[name]) for row in rows]))
        except (TypeError, ValueError) as error:
            raise RunError(f"{path}: column {name!r} holds more than numbers.") from error
    if (np.diff(columns[0]) <= 0).any():
        raise RunError(f"{path}: the steps do not increase from row to row.")
    return Curve(*columns)
