"""The files of built-in robots."""

from pathlib import Path

from fbid_gym.errors import RobotError
from fbid_gym.own_files import asset_places


def asset_path(name: str) -> Path:
    """Path of a file in `assets/`.

    Raises:
        RobotError: there is no such file.
    """
    places = asset_places(name)
    for path in places:
        if path.is_file():
            return path
    raise RobotError(f"Asset {name!r} not found. Looked at: {', '.join(map(str, places))}.")
