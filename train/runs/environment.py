"""What the arguments of a run's environment mean: defaults may change after a run began."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fbid_gym.envs.config import resolved_arguments
from fbid_gym.errors import FbidError
from fbid_gym.policy import Card
from fbid_gym.policy.shipping import CARD
from fbid_gym.robots import Robot
from train.runs.differences import environment_differences, in_words
from train.runs.files import read_json
from train.runs.folder import RunFolder
from train.runs.robots import of_policy


def meaning(config: Mapping[str, Any], robot: Robot | None = None) -> dict[str, Any] | None:
    """Return what the environment's arguments in a `config.json` mean today.

    Args:
        config: as `TrainConfig.to_json` gives it.
        robot: instead of the one that they name.

    Returns:
        As `environment.json` holds it; None where the environment is not one of ours.

    Raises:
        FbidError: they are not valid today.
    """
    arguments = dict(config.get("env_args") or {})
    if robot is not None:
        arguments["robot"] = robot
    return resolved_arguments(str(config.get("env_id")), arguments)


def changed_meaning(path: Path) -> str | None:
    """Compare what a run's arguments meant when it began with what they mean today.

    Args:
        path: folder of a run, or of a shipped policy. Another exported policy and a run of
            another environment do not say what their arguments meant.

    Returns:
        One sentence that names what differs; None where nothing does or nothing is known.

    Raises:
        RunError: a file of the run that is not JSON.
        PolicyFileError: the card of a shipped policy is damaged.
    """
    folder = RunFolder.of(path)
    if (path / CARD).is_file():
        card = Card.read(path / CARD)
        config: Mapping[str, Any] = {"env_id": card.env_id, "env_args": card.env_args}
        stored = card.environment
    elif folder.environment.is_file() and folder.config.is_file():
        config, stored = read_json(folder.config), read_json(folder.environment)
    else:
        return None
    try:
        today = meaning(config, of_policy(path, config.get("env_args") or {}))
    except FbidError as error:
        return f"{path.name} was trained in an environment that is not valid today: {error}"
    different = environment_differences(stored, today or {})
    if not different:
        return None
    return (
        f"{path.name} was trained in another environment than its arguments make today: "
        f"{in_words(different)}."
    )
