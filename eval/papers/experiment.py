"""What an experiment is: it runs and saves data, then draws its section from what it saved."""

import io
import json
import shlex
import sys
import time
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import msgspec
import numpy as np
from markupsafe import Markup

from eval.files import read_json, to_json, write
from eval.papers.page import Finding
from fbid_gym.errors import RunError
from fbid_gym.reading import MOST_DATA, read_file
from train.command import run_command

OUT = Path("runs/papers")
_SHOWN_EVERY = 1.0
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
class Result:
    """What a run found.

    Attributes:
        findings: the paper's numbers beside ours, for the head of the section and of the page.
        numbers: everything else that tables need, as JSON can hold it.
        arrays: what figures need.
    """

    findings: list[Finding]
    numbers: dict[str, Any]
    arrays: dict[str, Any]


def row(rows: Sequence[dict[str, Any]], **values: Any) -> dict[str, Any]:
    """Return the row of a result that has these values."""
    return next(found for found in rows if found.items() >= values.items())


@dataclass(frozen=True)
class Experiment:
    """One figure or claim of a paper.

    Attributes:
        module: dotted name of its script.
        title: what it shows.
        about: what was done, in one or two sentences.
        run: does it.
        show: turns a result, as it was saved, into the pieces of its section.
        minutes: that it takes, roughly; the longest are started first.
    """

    module: str
    title: str
    about: str
    run: Callable[[Setting], Result]
    show: Callable[[Result], Sequence[str]]
    minutes: float = 1.0

    @property
    def name(self) -> str:
        """Last part of the module's name."""
        return self.module.rpartition(".")[2]

    @property
    def paper(self) -> str:
        """Name of the paper's package."""
        return self.module.split(".")[-2]

    def folder(self, out: Path) -> Path:
        """Where its data lie."""
        return out / self.paper / self.name

    def command(self, quick: bool) -> str:
        """Return the command that runs it alone."""
        return shlex.join(["python", "-m", self.module, *(["--quick"] if quick else [])])


def save(experiment: Experiment, out: Path, result: Result, about: dict[str, Any]) -> None:
    """Write `data.npz` and `numbers.json` into the experiment's folder."""
    folder, buffer = experiment.folder(out), io.BytesIO()
    np.savez_compressed(buffer, **result.arrays)
    write(folder / "data.npz", buffer.getvalue())
    findings = [asdict(finding) for finding in result.findings]
    numbers = {"findings": findings, "numbers": result.numbers, "run": about}
    write(folder / "numbers.json", to_json(numbers))


@dataclass(frozen=True)
class Run:
    """How an experiment was run.

    Attributes:
        quick: in the quick form.
        seconds: that it took.
    """

    quick: bool
    seconds: float


class _Saved(msgspec.Struct):
    """What stands in `numbers.json`."""

    findings: list[Finding]
    numbers: dict[str, Any]
    run: Run


_UNFIT = (KeyError, ValueError, IndexError, TypeError, AttributeError, StopIteration)


def load(experiment: Experiment, out: Path) -> tuple[Result, Run]:
    """Read what `save` wrote: the result, and how it was run.

    Raises:
        RunError: the experiment has not been run, or its files are not what `save` wrote.
    """
    folder = experiment.folder(out)
    for name in ("data.npz", "numbers.json"):
        if not (folder / name).is_file():
            raise RunError(f"{folder} holds no {name}. Run: {experiment.command(False)}")
    arrays, saved = _arrays(folder / "data.npz"), read_json(folder / "numbers.json")
    try:
        read = msgspec.convert(saved, _Saved)
    except msgspec.ValidationError as error:
        raise RunError(f"{folder / 'numbers.json'}: not of this experiment ({error}).") from error
    return Result(read.findings, read.numbers, arrays), read.run


def drawn(experiment: Experiment, result: Result) -> Markup:
    """Return the section of a result.

    Raises:
        RunError: numbers or arrays that the experiment needs are not there, or others.
    """
    try:
        return Markup("").join(experiment.show(result))
    except _UNFIT as error:
        kind = type(error).__name__
        raise RunError(f"{experiment.name}: its data do not fit it ({kind}: {error}).") from error


def _arrays(path: Path) -> dict[str, np.ndarray]:
    packed = io.BytesIO(read_file(path, MOST_DATA, RunError))
    try:
        with zipfile.ZipFile(packed) as file:
            size = sum(entry.file_size for entry in file.infolist())
        if size > MOST_DATA:
            raise RunError(f"{path}: unpacks to more than {MOST_DATA >> 20} MB.")
        with np.load(packed, allow_pickle=False) as arrays:
            return dict(arrays)
    except (*_UNFIT, OSError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise RunError(f"{path}: no arrays, truncated or corrupt ({error}).") from error


@dataclass(frozen=True)
class ScriptConfig:
    """Run one experiment, save its data, draw its section."""

    quick: bool = False
    """Fewer robots, shorter runs, coarser sweeps."""
    out: Path = OUT
    """Folder of the papers' experiments."""
    draw_only: bool = False
    """Draw the section from the data that are there."""


def main(experiment: Experiment) -> NoReturn:
    """Command line of one experiment. An error of ours is one line and exit status 2."""
    about, work = f"{experiment.title}. {experiment.about}", partial(_perform, experiment)
    sys.exit(run_command(experiment.module, ScriptConfig, work, about=about))


def _perform(experiment: Experiment, config: ScriptConfig) -> None:
    folder = experiment.folder(config.out)
    if not config.draw_only:
        began = time.monotonic()
        setting = Setting(config.quick, Progress(folder / "progress.json"))
        result = experiment.run(setting)
        seconds = time.monotonic() - began
        save(experiment, config.out, result, {"quick": config.quick, "seconds": seconds})
    result, run = load(experiment, config.out)
    write(folder / "section.html", drawn(experiment, result))
    for finding in result.findings:
        print(f"{finding.what}: {finding.ours} (paper: {finding.paper})")
    print(f"{run.seconds:.0f} s. Section: {folder / 'section.html'}")
