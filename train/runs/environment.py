"""What the arguments of a run's environment mean: defaults may change after a run began."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fbid_gym.envs.config import resolved_arguments
from fbid_gym.errors import FbidError
from train.runs.differences import differences, in_words
from train.runs.files import read_json
from train.runs.folder import RunFolder


def meaning(config: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return what the environment's arguments in a `config.json` mean today.

    Returns:
        As `environment.json` holds it; None where the environment is not one of ours.

    Raises:
        FbidError: they are not valid today.
    """
    return resolved_arguments(str(config.get("env_id")), config.get("env_args") or {})


def changed_meaning(path: Path) -> str | None:
    """Compare what a run's arguments meant when it began with what they mean today.

    Args:
        path: folder of a run. An exported policy and a run of another environment do not say what
            their arguments meant.

    Returns:
        One sentence that names what differs; None where nothing does or nothing is known.

    Raises:
        RunError: a file of the run that is not JSON.
    """
    folder = RunFolder.of(path)
    if not (folder.environment.is_file() and folder.config.is_file()):
        return None
    config = read_json(folder.config)
    try:
        today = meaning(config)
    except FbidError as error:
        return f"{path.name} was trained in an environment that is not valid today: {error}"
    different = differences(read_json(folder.environment), today or {})
    if not different:
        return None
    return (
        f"{path.name} was trained in another environment than its arguments make today: "
        f"{in_words(different)}."
    )
