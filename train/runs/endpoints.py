"""Endpoints of a study: registered in its file before its trainings begin, and kept beside them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fbid_gym.errors import RunError, UnknownOptionError
from train.runs.files import read_json, to_json, write

MEASURES = (
    *("return_mean", "velocity_error", "turning_error", "slip", "falls", "cost_of_transport"),
)
"""What can be asked: columns of `evaluations.csv`, and falls."""

MOST = 3
"""Endpoints of a study: of many questions some come out by chance."""


class Endpoint(NamedTuple):
    """One question: does an arm do better than another in a measure?"""

    measure: str
    env: str
    arm: str
    against: str


def endpoints(path: Path, given: Any, arms: Sequence[tuple[str, str]]) -> tuple[Endpoint, ...]:
    """Read the `[[endpoints]]` of a study, which has these arms: environment and name of each.

    Raises:
        RunError: more of them than `MOST`, or one that lacks something.
        UnknownOptionError: a measure or an arm that there is not.
    """
    if not isinstance(given, list) or not all(isinstance(each, dict) for each in given):
        raise RunError(f"{path}: endpoints are no list of tables. Expected [[endpoints]].")
    if len(given) > MOST:
        raise RunError(f"{path}: has {len(given)} endpoints. Expected {MOST} at most.")
    return tuple(_endpoint(path, each, arms) for each in given)


def _endpoint(path: Path, given: Mapping[str, Any], arms: Sequence[tuple[str, str]]) -> Endpoint:
    named = {"env": arms[0][0], **given}
    missing = [name for name in Endpoint._fields if not isinstance(named.get(name), str)]
    if missing:
        raise RunError(f"{path}: an endpoint without {missing[0]}. Expected one: {dict(given)}.")
    for name in named:
        if name not in Endpoint._fields:
            raise UnknownOptionError("setting of an endpoint", name, Endpoint._fields)
    found = Endpoint(**named)
    if found.measure not in MEASURES:
        raise UnknownOptionError("measure of an endpoint", found.measure, MEASURES)
    for arm in (found.arm, found.against):
        if (found.env, arm) not in arms:
            names = [name for env, name in arms if env == found.env]
            raise UnknownOptionError(f"arm of an endpoint in {found.env}", arm, names)
    return found


def register(name: str, runs: Path, asked: Sequence[Endpoint]) -> None:
    """Keep the endpoints of a study beside its runs, before the first of them begins."""
    if asked and not (file := _file(name, runs)).exists():
        write(file, to_json(_told(asked)))


def check_registered(name: str, runs: Path, asked: Sequence[Endpoint], *, begun: bool) -> None:
    """Raise RunError for endpoints other than those with which a study began, if it has `begun`."""
    file = _file(name, runs)
    if file.exists():
        if read_json(file) != _told(asked):
            raise RunError(
                f"{file}: the study began with other endpoints. Expected those: what is asked is "
                "said before the answer is known. Ask something else in a study of its own."
            )
    elif asked and begun:
        raise RunError(
            f"{runs}: holds runs of study {name!r}, which began without endpoints. Expected none: "
            "what is asked is said before the answer is known."
        )


def _told(asked: Sequence[Endpoint]) -> dict[str, Any]:
    return {"endpoints": [each._asdict() for each in asked]}


def _file(name: str, runs: Path) -> Path:
    return runs / f"{name}.endpoints.json"
