"""Trying a subject on random cases, shrinking what fails, and keeping it for later."""

import hashlib
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import hypothesis
from hypothesis import HealthCheck, Phase, settings

from fbid_gym.errors import RunError
from fbid_gym.reading import read_object

_ROUND = 20
"""Cases with one seed."""


class Subject(Protocol):
    """A module of this package."""

    UNIT: str
    """Of what a case may hold several, in words."""

    def amount(self, case: dict[str, Any]) -> int:
        """Return how many of them a case holds."""

    def cases(self) -> Any:
        """Return a Hypothesis strategy for cases, which JSON can hold."""

    def faults(self, case: dict[str, Any]) -> Iterator[str]:
        """Yield what goes wrong in a case, one sentence each."""


class Outcome(NamedTuple):
    """Of the search in one subject."""

    tried: int
    """Cases."""
    amount: int
    """What there was of `Subject.amount` in them."""
    failures: list[Path]
    """Files of those that failed, one a round."""


class _Fault(Exception):
    def __init__(self, case: dict[str, Any], found: list[str]) -> None:
        super().__init__("; ".join(found))
        self.case, self.found = case, found


def faults_in(subject: Subject, case: dict[str, Any]) -> list[str]:
    """Return what goes wrong in a case; what a subject does not expect to be raised is a fault."""
    try:
        return list(subject.faults(case))
    except Exception as error:
        return [f"{type(error).__name__}: {error}"]


def search(name: str, subject: Subject, seed: int, seconds: float, folder: Path) -> Outcome:
    """Try random cases until the time is over.

    The case that is being tried is in the folder, too, so that one that ends the process is kept.

    Args:
        name: of the subject.
        subject: to try.
        seed: of the first round; the next has the next.
        seconds: to search for; what is being tried then is finished, and shrunk if it fails. One
            case is tried at least.
        folder: for failures.
    """
    folder.mkdir(parents=True, exist_ok=True)
    trying, end = folder / f"{name}-trying.json", time.monotonic() + seconds
    tried, amount, failures = 0, 0, set[Path]()
    while not tried or time.monotonic() < end:
        failing = False

        def check(case: dict[str, Any]) -> None:
            nonlocal tried, amount, failing
            if tried and not failing and time.monotonic() > end:
                return
            if not failing:
                tried, amount = tried + 1, amount + subject.amount(case)
            trying.write_text(_text(name, case, ["the process ended"]))
            if found := faults_in(subject, case):
                failing = True
                raise _Fault(case, found)

        chosen = settings(
            max_examples=_ROUND,
            deadline=None,
            database=None,
            phases=(Phase.generate, Phase.shrink),
            report_multiple_bugs=False,
            print_blob=False,
            suppress_health_check=list(HealthCheck),
        )
        try:
            hypothesis.seed(seed)(chosen(hypothesis.given(subject.cases())(check)))()
        except _Fault as fault:
            failures.add(_keep(folder, name, fault))
        seed += 1
    trying.unlink(missing_ok=True)
    return Outcome(tried, amount, sorted(failures))


def read_case(path: Path, subjects: dict[str, Subject]) -> tuple[Subject, dict[str, Any]]:
    """Return the subject and the case of a file that `search` kept.

    Raises:
        RunError: the file is none.
    """
    kept = read_object(path, RunError)
    if kept.get("subject") not in subjects or not isinstance(kept.get("case"), dict):
        raise RunError(f"{path}: holds no case. Expected a file that the search kept.")
    return subjects[kept["subject"]], kept["case"]


def _keep(folder: Path, name: str, fault: _Fault) -> Path:
    text = _text(name, fault.case, fault.found)
    path = folder / f"{name}-{hashlib.sha256(text.encode()).hexdigest()[:8]}.json"
    path.write_text(text)
    return path


def _text(name: str, case: dict[str, Any], found: list[str]) -> str:
    return json.dumps({"subject": name, "case": case, "faults": found}, indent=1) + "\n"
