"""Differences between two runs, for resumes and for comparisons."""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

from train.runs.config import ALGORITHMS, completed

_UNSET = object()

# Change how fast a run is and what is kept of it, but not one number of its curve: a robot computes
# the same on whichever thread it is.
_OUTSIDE_THE_CURVE = ("num_threads", "checkpoint_every")
# How far a run goes may be changed later. The rest is said twice in `config.json`, for readers of
# the environment's arguments alone.
_FREE_TO_RESUME = (
    *_OUTSIDE_THE_CURVE, "total_steps", "env_args.action_layer", "env_args.layer_options",
)  # fmt: skip
# Subjects of a comparison, or checked by it; evaluations do not disturb the training, and the
# threads of torch only change rounding.
_FREE_TO_COMPARE = (
    *_OUTSIDE_THE_CURVE, "env_id", "env_args", "action_layer", "layer_options", "seed", "eval",
    "torch_threads",
)  # fmt: skip
# Neither changes a number: uncommitted changes are known to be some, not which.
_FREE_VERSIONS = ("cpu_count", "uncommitted_changes")


class Difference(NamedTuple):
    """A value that is another on the other side."""

    name: str  # keys from the outside in, joined by dots
    one: Any
    other: Any

    def __str__(self) -> str:
        """Return "name other instead of one"."""
        other, one = ("unset" if x is _UNSET else json.dumps(x) for x in (self.other, self.one))
        return f"{self.name} {other} instead of {one}"


def differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[Difference]:
    """Return the entries of two nested dictionaries that differ or are on one side, by name."""
    one, other = flat(one), flat(other)
    return [
        Difference(name, one.get(name, _UNSET), other.get(name, _UNSET))
        for name in sorted(one.keys() | other.keys())
        if one.get(name, _UNSET) != other.get(name, _UNSET)
    ]


def environment_differences(
    stored: Mapping[str, Any], today: Mapping[str, Any]
) -> list[Difference]:
    """Return the differences between environments, each as its `environment.json` has it.

    An argument, or an option of the layer or of the randomisation, that is not stored is younger
    than that file: it was at its default, as it is today where nobody gives it. Options that the
    layer no longer has are left out.
    """
    filled = {**today, **stored}
    for name in ("layer_options", "randomisation"):
        if isinstance(stored.get(name), Mapping):
            filled[name] = {**today.get(name, {}), **stored[name]}
    if stored.get("action_layer") == today.get("action_layer"):
        kept = today.get("layer_options", {}).keys()
        filled["layer_options"] = {k: filled["layer_options"][k] for k in kept}
    return differences(filled, today)


def in_words(found: list[Difference]) -> str:
    """Join differences for a sentence."""
    return ", ".join(map(str, found))


def run_differences(stored: Mapping[str, Any], asked: Mapping[str, Any]) -> list[Difference]:
    """Return the differences that make two configurations different runs; none for a resume.

    Args:
        stored: the `config.json` of a run folder.
        asked: the configuration that is asked for, in the same form.
    """
    one, other = (_without(completed(each), _FREE_TO_RESUME) for each in (stored, asked))
    return _of_runs(one, other)


def training_differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[Difference]:
    """Return the differences between the `training_settings` of two runs."""
    return _of_runs(training_settings(one), training_settings(other))


def training_settings(config: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings that should be the same in all runs of a comparison, flat."""
    return _without(completed(config), _FREE_TO_COMPARE)


def made_with(versions: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part of `versions.json` that the numbers of a run depend on, flat."""
    found = _without(versions, _FREE_VERSIONS)
    return {name.removeprefix("packages."): value for name, value in found.items()}


def flat(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Join the keys of nested dictionaries with dots."""
    joined: dict[str, Any] = {}
    for key, value in data.items():
        if isinstance(value, Mapping):
            joined |= flat(value, f"{prefix}{key}.")
        else:
            joined[prefix + key] = value
    return joined


def _of_runs(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[Difference]:
    """Return the differences; hyperparameters of two algorithms are not compared."""
    found = differences(one, other)
    if one["algorithm"] == other["algorithm"]:
        return found
    return [each for each in found if each.name.partition(".")[0] not in ALGORITHMS]


def _without(data: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    """Return the flat data without these names and the names below them."""
    below = tuple(f"{name}." for name in names)
    return {
        name: value
        for name, value in flat(data).items()
        if name not in names and not name.startswith(below)
    }
