"""The file of a policy: its place, and the entries of its JSON."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fbid_gym.bundles import present_bundle
from fbid_gym.checks import is_number
from fbid_gym.errors import PolicyFileError

FORMAT = 2
READABLE = (1, FORMAT)
"""Formats that are read; of the first all are clipped and trained by PPO, and do not say so."""

NAME = "policy"
"""Stem of both files, and of the folder of them in a run folder."""

_NETWORK = ("activation", "hidden", "output")  # in the JSON; the last since format 2


def read_policy(data: Mapping[str, Any], file: Path) -> tuple[dict[str, Any], tuple[int, ...]]:
    """Read the entries of `policy.json`.

    Returns:
        Arguments of `Policy`, all but its arrays; and widths, from observations to actions.

    Raises:
        PolicyFileError: of an unknown format, or a value of another type; names the file.
    """
    form = data.get("format")
    if type(form) is not int or form not in READABLE:
        raise PolicyFileError(
            f"{file}: format is {form!r}. Expected {' or '.join(map(str, READABLE))}."
        )

    def get(key: str, *kinds: type) -> Any:
        value: Any = data
        for part in key.split("."):
            value = value.get(part) if isinstance(value, dict) else None
        return typed(value, kinds, key, file)

    def size(key: str, value: Any) -> int:
        if not isinstance(value, int) or isinstance(value, bool) or value < 1:
            raise PolicyFileError(f"{file}: {key} is {value!r}. Expected a positive integer.")
        return value

    def positive(key: str) -> float:
        value = get(key, int, float)
        if not is_number(value) or not 0 < value < float("inf"):
            raise PolicyFileError(f"{file}: {key} is {value!r}. Expected a positive number.")
        return float(value)

    env_id = get("env_id", str)
    if ":" in env_id:  # Gymnasium imports what stands before it
        raise PolicyFileError(
            f"{file}: env_id is {env_id!r}, which names a module to import. Expected the id "
            "alone, of an environment that is registered; --register MODULE imports one of "
            "yours."
        )
    hidden = [size("network.hidden", value) for value in get("network.hidden", list)]
    known = _NETWORK if form > 1 else _NETWORK[:-1]
    unknown = sorted(data["network"].keys() - set(known))
    if unknown:
        raise PolicyFileError(
            f"{file}: network has {unknown[0]!r}. Expected {', '.join(known)} alone."
        )
    observations = size("observation_size", data.get("observation_size"))
    actions = size("action_size", data.get("action_size"))
    said = {
        "env_id": env_id,
        "env_args": get("env_args", dict),
        "activation": get("network.activation", str),
        "output": get("network.output", str) if form > 1 else "clip",
        "clip": positive("normalisation.clip"),
        "epsilon": positive("normalisation.epsilon"),
        "algorithm": get("algorithm", str) if form > 1 else "ppo",
        "trained_steps": get("trained_steps", int),
        "versions": get("versions", dict),
    }
    return said, (observations, *hidden, actions)


def typed(value: Any, kinds: tuple[type, ...], name: str, file: Path) -> Any:
    """Return a value of a file, or raise a PolicyFileError unless it is of one of some types."""
    # bool is an int to Python, but no size or number here may be one
    if not isinstance(value, kinds) or isinstance(value, bool):
        expected = kinds[0].__name__ if len(kinds) == 1 else "number"
        raise PolicyFileError(f"{file}: {name} is {value!r}. Expected a value of type {expected}.")
    return value


def check_tensors(widths: tuple[int, ...], tensors: Mapping[str, np.ndarray], file: Path) -> None:
    """Raise where the tensors are not those the JSON describes."""
    expected: dict[str, tuple[int, ...]] = {
        "normalisation.mean": widths[:1],
        "normalisation.variance": widths[:1],
    }
    for k, (inputs, outputs) in enumerate(zip(widths, widths[1:], strict=False)):
        expected[f"layers.{k}.weight"] = (outputs, inputs)
        expected[f"layers.{k}.bias"] = (outputs,)
    missing = sorted(set(expected) - set(tensors))
    if missing:
        raise PolicyFileError(
            f"{file}: tensor {missing[0]!r} is missing. Expected {', '.join(expected)}."
        )
    for name, shape in expected.items():
        if tensors[name].shape != shape or tensors[name].dtype.kind != "f":
            raise PolicyFileError(
                f"{file}: tensor {name!r} is {tensors[name].dtype} {tensors[name].shape}. "
                f"Expected floats of shape {shape}, as {NAME}.json says."
            )


def policy_folder(path: Path) -> Path:
    """Find the policy in a policy folder, or in a run folder.

    Raises:
        PolicyFileError: there is neither.
    """
    if not path.exists() and present_bundle(path) == path:
        raise PolicyFileError(
            f"{path}: no such folder. Expected a policy folder ({NAME}.json, "
            f"{NAME}.safetensors) or a run folder with {NAME}/."
        )
    if path.is_file():
        raise PolicyFileError(f"{path}: is a file. Expected the folder that holds the policy.")
    nested = path / NAME
    if (path / f"{NAME}.json").exists() or not path.exists():
        return path
    if nested.exists() or present_bundle(nested) != nested:
        return nested
    if (path / "config.json").exists():
        raise PolicyFileError(
            f"{path}: this run has exported no policy yet. Expected {NAME}/ in it, which "
            "training writes at every evaluation and checkpoint."
        )
    raise PolicyFileError(
        f"{path}: no policy here. Expected {NAME}.json and {NAME}.safetensors, or a run folder "
        f"with {NAME}/."
    )
