"""`robot.toml`: what a file of a robot does not say of it, beside the file."""

import json
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fbid_gym.checks import check_choices
from fbid_gym.errors import InvalidValueError, RobotError
from fbid_gym.reading import read_file
from fbid_gym.robots.archive import ARGUMENTS, MOST_BYTES, SUFFIX, split
from fbid_gym.robots.bounds import MOST_TEXT
from fbid_gym.robots.source import Source, is_file

FILE = "robot.toml"


def described(source: Any) -> tuple[Any, dict[str, Any]]:
    """Return what to load, and the other arguments of `Robot.from_mjcf`.

    The source is the path of a `robot.toml` or of what `Robot.save` wrote, or what `from_mjcf`
    takes: a file is looked up in the `robot.toml` of its folder, if that is about this file.

    Raises:
        RobotError: a file that is not TOML, or no archive of a robot.
        UnknownOptionError: a key that means nothing.
        InvalidValueError: a key `mjcf` that is no path.
    """
    if not isinstance(source, str | Path) or str(source).lstrip().startswith("<"):
        return source, {}
    path = Path(source)
    if path.suffix == ".toml":
        return _read(path)
    if path.suffix == SUFFIX:
        archive = read_file(path, MOST_BYTES, RobotError)
        packed, options = split(archive, str(path))
        return Source.known(packed), options
    beside = path.parent / FILE
    if not (is_file(path) and is_file(beside)):
        return source, {}
    about, options = _read(beside, path.name)
    if not is_file(about):
        raise RobotError(f"{beside}: its mjcf, {str(about)!r}, does not exist.")
    return source, options if about.resolve() == path.resolve() else {}


def feet_in_words(words: Sequence[str] | None) -> Any:
    """Return the argument `feet` of `Robot.from_mjcf` from words: names, or JSON, see `in_json`."""
    if words and words[0][:1] in ("{", "["):
        return in_json("feet", " ".join(words))
    return list(words) if words else None


def in_json(name: str, text: str) -> Any:
    """Return what JSON says; InvalidValueError where it is none."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        raise InvalidValueError(name, text, "JSON") from None


def _read(path: Path, usual: str = "robot.xml") -> tuple[Path, dict[str, Any]]:
    """The file that a `robot.toml` is about, `usual` unless it says, and its other arguments."""
    text = read_file(path, MOST_TEXT, RobotError)
    try:
        options = tomllib.loads(text.decode())
    except (ValueError, RecursionError) as error:  # no UTF-8, no TOML, or too deep
        raise RobotError(f"Robot file {str(path)!r} is not valid TOML: {error}") from error
    check_choices(f"key in {path.name}", options, ("mjcf", *ARGUMENTS))
    mjcf = options.pop("mjcf", usual)
    if not isinstance(mjcf, str) or "\0" in mjcf:
        raise InvalidValueError(f"mjcf in {path.name}", mjcf, "the path of a file")
    return path.parent / mjcf, options
