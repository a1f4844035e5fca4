"""Episodes that decided about nothing: what is measured to be reported begins from other seeds."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fbid_gym.errors import RunError


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
