"""Check that runs may be compared or measured, and find settings in which they differ."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fbid_gym.errors import RunError
from fbid_gym.robots import Robot
from train.runs.config import unusual
from train.runs.differences import differences, in_words, made_with, training_differences
from train.runs.environment import changed_meaning
from train.runs.reading import Run
from train.runs.robots import another


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
        arguments = (unusual(each.policy.env_id, each.env_args) for each in (first, run))
        different = differences(*arguments)
        if different:
            raise RunError(
                f"{run.path} and {first.path} have different environment arguments, so a return "
                f"means different things: {in_words(different)}."
            )
    old = [warning for run in runs for warning in changed(run.path, run.env_args, run.robot)]
    return old + _training_warnings(runs)


def changed(path: Path, env_args: Mapping[str, Any], robot: Robot | None) -> list[str]:
    """Say how what is played differs from what was trained in a folder, or with a policy's file."""
    found = another(path, env_args, robot), changed_meaning(path)
    return [warning for warning in found if warning is not None]


def check_unseen(first: int, episodes: int, config: Mapping[str, Any], folder: Path) -> None:
    """Raise RunError where a training was evaluated from seeds that are to be measured from.

    The measurement begins with seed `first`, and each episode has the next one.
    """
    own = config.get("eval", {})
    begin, number = own.get("seed", 0), own.get("episodes", 0) if own.get("every") else 0
    if first < begin + number and begin < first + episodes:
        raise RunError(
            f"{folder}: was evaluated from seeds {begin} to {begin + number - 1}. Expected none of "
            f"those from which it is to be measured, {first} to {first + episodes - 1}."
        )


def _training_warnings(runs: Sequence[Run]) -> list[str]:
    warnings = []
    trained = [run for run in runs if run.config is not None]
    for run in trained[1:]:
        first, own = trained[0].config or {}, run.config or {}
        evaluations = ({"eval": config.get("eval", {})} for config in (first, own))
        curves = "So their learning curves, and the times read from them, are not quite of the same"
        for done, different, so in (
            ("trained", training_differences(first, own), "The layer is not the only difference"),
            ("evaluated", differences(*evaluations), curves),
        ):
            if different:
                unlike = f"{run.path.name} was not {done} like {trained[0].path.name}"
                warnings.append(f"{unlike}: {in_words(different)}. {so}.")
    for layer, members in group(trained).items():
        seeds = [run.seed for run in members]
        twice = sorted({seed for seed in seeds if seeds.count(seed) > 1 and seed is not None})
        if twice:
            warnings.append(
                f"{layer}: several runs have seed {', '.join(map(str, twice))}. They are "
                "counted as independent, which they are not."
            )
    warnings += origin_warnings([made_with(run.versions) for run in trained])
    counts = {layer: len(members) for layer, members in group(runs).items()}
    if len(set(counts.values())) > 1:
        described = ", ".join(f"{layer} {count}" for layer, count in counts.items())
        warnings.append(f"The layers have different numbers of runs: {described}.")
    return warnings


_ORIGINS = {"platform": "machines", "commit": "commits of this project"}


def origin_warnings(versions: Sequence[Mapping[str, Any]]) -> list[str]:
    """Name the machines, commits and packages that are not the same for all runs."""
    found = []
    for name in sorted({name for its in versions for name in its}):
        values = sorted({str(its.get(name) or "unknown") for its in versions})
        if len(values) > 1:
            what = _ORIGINS.get(name, f"versions of {name}")
            found.append(f"The runs come from different {what}: {', '.join(values)}.")
    return found
