"""What an experiment is: a function that measures, and returns its findings and its section."""

import importlib
import json
import shlex
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeVar

import msgspec
from markupsafe import Markup

from eval.files import read_json, to_json, write
from eval.page.html import text
from fbid_gym.errors import RunError

OUT = Path("runs/papers")
_SHOWN_EVERY = 1.0  # s
Item = TypeVar("Item")


class Progress:
    """How far an experiment is, kept in a small file that whoever started it may read."""

    def __init__(
        self, path: Path | None, low: float = 0.0, high: float = 1.0, note: str = ""
    ) -> None:
        """Tell of the part of an experiment from `low` to `high`; without a path, of nothing."""
        self._path, self._low, self._high, self._note = path, low, high, note
        self._written = 0.0

    def part(self, low: float, high: float, note: str = "") -> "Progress":
        """Return the progress of a part that goes from `low` to `high` of this one."""
        width = self._high - self._low
        note = ", ".join(filter(None, (self._note, note)))
        inner = Progress(self._path, self._low + low * width, self._low + high * width, note)
        inner(0.0)
        return inner

    def each(
        self, items: Iterable[Item], note: Callable[[Item], str] = str
    ) -> "Iterator[tuple[Item, Progress]]":
        """Go through equal parts, one after another: each item with its progress."""
        every = list(items)
        for k, item in enumerate(every):
            yield item, self.part(k / len(every), (k + 1) / len(every), note(item))

    def __call__(self, share: float) -> None:
        """Note that this share of the part is done; written at most once a second."""
        now = time.monotonic()
        if self._path is None or (0.0 < share < 1.0 and now - self._written < _SHOWN_EVERY):
            return
        self._written = now
        whole = self._low + share * (self._high - self._low)
        write(self._path, json.dumps({"share": whole, "note": self._note}))


@dataclass(frozen=True)
class Setting:
    """How an experiment runs.

    Attributes:
        quick: fewer robots, shorter runs, coarser sweeps; what is left is the same code.
        progress: to be told how far it is.
    """

    quick: bool = False
    progress: Progress = field(default_factory=lambda: Progress(None))

    def pick(self, full: Any, quick: Any) -> Any:
        """Return one of the two."""
        return quick if self.quick else full


@dataclass(frozen=True)
class Finding:
    """One number of a paper beside ours.

    Attributes:
        what: is measured.
        paper: what the paper has.
        ours: what came out here.
        verdict: "met" or "missed" where ours has a target, else "shown".
        target: what ours should be; empty without a target.
    """

    what: str
    paper: str
    ours: str
    verdict: Literal["met", "missed", "shown"] = "shown"
    target: str = ""


def judged(what: str, paper: str, ours: str, target: str, holds: bool) -> Finding:
    """Return a finding that has a target."""
    return Finding(what, paper, ours, "met" if holds else "missed", target)


def fate(fell: float | None) -> str:
    """Say whether a robot stayed up; `fell` is when it fell, s."""
    return "stays up" if fell is None else f"falls at {fell:.1f} s"


def prose(words: str) -> Markup:
    """Paragraphs, parted by empty lines."""
    return text(*words.strip().split("\n\n"))


def row(rows: Sequence[dict[str, Any]], **values: Any) -> dict[str, Any]:
    """Return the row of a result that has these values."""
    return next(found for found in rows if found.items() >= values.items())


@dataclass(frozen=True)
class Result:
    """What a run found.

    Attributes:
        findings: the paper's numbers beside ours, for the head of the section and of the page.
        numbers: all that was measured, as JSON can hold it.
        body: pieces of the section, HTML where they are Markup.
    """

    findings: list[Finding]
    numbers: dict[str, Any]
    body: Sequence[str]


class Run(msgspec.Struct):
    """What a run has left in `numbers.json`.

    Attributes:
        findings: the paper's numbers beside ours.
        numbers: all that was measured.
        quick: whether this was the quick form.
        seconds: that it took.
    """

    findings: list[Finding]
    numbers: dict[str, Any]
    quick: bool
    seconds: float


@dataclass(frozen=True)
class Experiment:
    """One figure or claim of a paper.

    Attributes:
        title: what it shows.
        about: what was done, in one or two sentences.
        minutes: that it takes, roughly; the longest are started first.
        run: does it.
    """

    title: str
    about: str
    minutes: float
    run: Callable[[Setting], Result]

    @property
    def name(self) -> str:
        """That of its function."""
        return self.run.__name__

    @property
    def paper(self) -> str:
        """Name of the paper's package."""
        return self.run.__module__.split(".")[2]

    def folder(self, out: Path) -> Path:
        """Where its data lie."""
        return out / self.paper / self.name

    def command(self, quick: bool) -> str:
        """Return the command that runs it alone."""
        quickly = ["--quick"] if quick else []
        return shlex.join(["python", "-m", "eval.papers", "--only", self.name, *quickly])


def experiment(
    title: str, about: str, minutes: float = 1.0
) -> Callable[[Callable[[Setting], Result]], Experiment]:
    """Make a function an experiment; see `Experiment`."""
    return lambda run: Experiment(title, " ".join(about.split()), minutes, run)


def found(package: str, module: str, name: str) -> Experiment:
    """Import an experiment of a paper's package."""
    there = importlib.import_module(f"eval.papers.{package}.{module}")
    return getattr(there, name)


def perform(experiment: Experiment, out: Path, quick: bool) -> Run:
    """Run an experiment and save its numbers and its section."""
    folder, began = experiment.folder(out), time.monotonic()
    result = experiment.run(Setting(quick, Progress(folder / "progress.json")))
    run = Run(result.findings, result.numbers, quick, time.monotonic() - began)
    write(folder / "numbers.json", to_json(msgspec.to_builtins(run)))
    write(folder / "section.html", Markup("").join(result.body))
    return run


def load(experiment: Experiment, out: Path) -> tuple[Run, Markup] | None:
    """Read what `perform` saved, its section as HTML; None where it did not run to the end.

    Raises:
        RunError: the files are not what `perform` wrote.
    """
    numbers, section = (experiment.folder(out) / n for n in ("numbers.json", "section.html"))
    if not section.is_file():
        return None
    try:
        return msgspec.convert(read_json(numbers), Run), Markup(section.read_text())
    except (msgspec.ValidationError, UnicodeDecodeError) as error:
        raise RunError(f"{numbers.parent}: not of this experiment ({error}).") from error
