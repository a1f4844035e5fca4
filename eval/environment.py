"""Whether a run was trained in the environment that its arguments make today."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from eval.files import read_json
from fbid_gym.envs.config import resolved_arguments
from fbid_gym.errors import FbidError
from train.config import flat


def changed_meaning(folder: Path) -> str | None:
    """Compare what a run's arguments meant when it began with what they mean today.

    Args:
        folder: of a run. An exported policy and a run of another environment do not say what their
            arguments meant.

    Returns:
        One sentence that names what differs; None where nothing does or nothing is known.

    Raises:
        RunError: a file of the run that is not JSON.
    """
    saved, config = folder / "environment.json", folder / "config.json"
    if not (saved.is_file() and config.is_file()):
        return None
    run = read_json(config)
    try:
        today = resolved_arguments(str(run.get("env_id")), run.get("env_args") or {})
    except FbidError as error:
        return f"{folder.name} was trained in an environment that is not valid today: {error}"
    then, now = flat(read_json(saved)), flat(today or {})
    different = differing_fields(then, now)
    if not different:
        return None
    return (
        f"{folder.name} was trained in another environment than its arguments make today: "
        f"{in_words(then, now, different)}."
    )


def differing_fields(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Names whose values differ, or that only one side has, sorted."""
    missing = object()
    return sorted(
        key for key in one.keys() | other.keys() if one.get(key, missing) != other.get(key, missing)
    )


def in_words(one: Mapping[str, Any], other: Mapping[str, Any], names: Sequence[str]) -> str:
    """Say of each name what it is on the other side instead of on the one."""
    return ", ".join(
        f"{name} {json.dumps(other[name]) if name in other else 'unset'} "
        f"instead of {json.dumps(one[name]) if name in one else 'unset'}"
        for name in names
    )
