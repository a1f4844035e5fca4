"""What an experiment is: it runs and saves data, then draws its section from what it saved."""

import json
import shlex
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import tyro

from eval.files import read_json, to_json, write
from eval.papers.parts import Finding
from fbid_gym.errors import FbidError, RunError

OUT = Path("runs/papers")
_SHOWN_EVERY = 1.0


class Progress:
    """How far an experiment is, kept in a small file that whoever started it may read."""

    def __init__(self, path: Path | None) -> None:
        """Write to `path`; None shows nothing."""
        self._path, self._written = path, 0.0
        self._low, self._high, self._note = 0.0, 1.0, ""

    def part(self, low: float, high: float, note: str) -> "Progress":
        """Return the progress of a part that goes from `low` to `high` of this one."""
        inner = Progress(self._path)
        width = self._high - self._low
        inner._low, inner._high = self._low + low * width, self._low + high * width
        inner._note = note
        inner(0.0)
        return inner

    def parts(self, names: Sequence[str]) -> "list[Progress]":
        """Split into equal parts, one after another. Each is shown once it is called."""
        found = []
        for k, name in enumerate(names):
            inner = Progress(self._path)
            width = (self._high - self._low) / len(names)
            inner._low, inner._high = self._low + k * width, self._low + (k + 1) * width
            inner._note = name
            found.append(inner)
        return found

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


@dataclass(frozen=True)
class Experiment:
    """One figure or claim of a paper.

    Attributes:
        module: dotted name of its script.
        title: what it shows.
        about: what was done, in one or two sentences.
        run: does it.
        show: turns a result, as it was saved, into the HTML of its section.
        minutes: that it takes, roughly; the longest are started first.
    """

    module: str
    title: str
    about: str
    run: Callable[[Setting], Result]
    show: Callable[[Result], str]
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
    from eval.papers.log import save_arrays

    folder = experiment.folder(out)
    save_arrays(folder / "data.npz", result.arrays)
    findings = [asdict(finding) for finding in result.findings]
    write(
        folder / "numbers.json",
        to_json({"findings": findings, "numbers": result.numbers, "run": about}),
    )


def load(experiment: Experiment, out: Path) -> tuple[Result, dict[str, Any]]:
    """Read what `save` wrote: the result, and how it was run.

    Raises:
        RunError: the experiment has not been run.
    """
    from eval.papers.log import load_arrays

    folder = experiment.folder(out)
    arrays = load_arrays(folder / "data.npz")
    if not (folder / "numbers.json").is_file():
        raise RunError(f"{folder} holds no numbers.json. Run: {experiment.command(False)}")
    saved = read_json(folder / "numbers.json")
    findings = [Finding(**row) for row in saved["findings"]]
    return Result(findings, saved["numbers"], arrays), saved["run"]


@dataclass(frozen=True)
class ScriptConfig:
    """Run one experiment, save its data, draw its section."""

    quick: bool = False
    """Fewer robots, shorter runs, coarser sweeps."""
    out: Path = OUT
    """Folder of the papers' experiments."""
    draw_only: bool = False
    """Draw the section from the data that are there."""


def main(experiment: Experiment, arguments: Sequence[str] | None = None) -> int:
    """Command line of one experiment. An error of ours is one line and exit status 2."""
    config = tyro.cli(
        ScriptConfig, prog=f"python -m {experiment.module}", args=arguments,
        description=f"{experiment.title}. {experiment.about}",
    )  # fmt: skip
    folder = experiment.folder(config.out)
    try:
        if not config.draw_only:
            began = time.monotonic()
            setting = Setting(config.quick, Progress(folder / "progress.json"))
            result = experiment.run(setting)
            seconds = time.monotonic() - began
            save(experiment, config.out, result, {"quick": config.quick, "seconds": seconds})
        result, run = load(experiment, config.out)
        write(folder / "section.html", experiment.show(result))
    except FbidError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for finding in result.findings:
        print(f"{finding.what}: {finding.ours} (paper: {finding.paper})")
    print(f"{run['seconds']:.0f} s. Section: {folder / 'section.html'}")
    return 0
