"""Experiments: a function measures, and the template of its name shows the results."""

import json
import shlex
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeVar

import msgspec
import numpy as np
from markupsafe import Markup

from eval.page import figures, html
from eval.papers.camera import logged
from eval.wording import number, percent
from fbid_gym.errors import RunError
from train.runs.files import read_json, to_json, write

OUT = Path("runs/papers")
Numbers = dict[str, Any]
Measured = tuple[Numbers, Numbers]
"""All numbers of an experiment, as JSON can hold them, and what else its section shows."""

Item = TypeVar("Item")


class Setting:
    """Settings of an experiment; its progress is kept in a small file, for whoever started it.

    Attributes:
        quick: fewer robots, shorter runs, coarser sweeps; what is left is the same code.
    """

    def __init__(self, quick: bool = False, path: Path | None = None) -> None:
        """Begin; progress is written to `path`, if there is one."""
        self.quick, self._path = quick, path
        self._at, self._part, self._note = 0.0, (0.0, 1.0), ""

    def pick(self, full: Any, quick: Any) -> Any:
        """Return one of the two."""
        return quick if self.quick else full

    def each(self, items: Iterable[Item], until: float = 1.0) -> Iterator[Item]:
        """Go through equal parts, one after another, each of which may have parts of its own.

        Args:
            items: one for each part, which it names.
            until: the share of the part around it that is done afterwards.
        """
        every, begun, (low, high), note = list(items), self._at, self._part, self._note
        end = low + until * (high - low)
        ends = np.linspace(begun, end, len(every) + 1).tolist()
        for item, *part in zip(every, ends, ends[1:], strict=False):
            name = ", ".join(map(str, item)) if isinstance(item, tuple) else str(item)
            self._at, self._part = part[0], (part[0], part[1])
            self._note = ", ".join(filter(None, (note, name)))
            if self._path is not None:
                write(self._path, json.dumps({"share": self._at, "note": self._note}))
            yield item
        self._at, self._part, self._note = end, (low, high), note


@dataclass(frozen=True)
class Finding:
    """One number of a paper beside ours."""

    what: str  # is measured
    paper: str  # what the paper has
    ours: str  # what came out here
    verdict: Literal["met", "missed", "shown"] = "shown"
    """"met" or "missed" where ours has a target, else "shown"."""
    target: str = ""  # what ours should be; empty without a target


class ExperimentRun(msgspec.Struct):
    """Numbers of a run, from `numbers.json`."""

    findings: list[Finding]  # the paper's numbers beside ours
    numbers: Numbers  # all that was measured
    quick: bool  # whether this was the quick form
    seconds: float  # that it took


@dataclass(frozen=True)
class Experiment:
    """One figure or claim of a paper."""

    title: str  # what it shows
    about: str  # what was done, in one or two sentences
    minutes: float  # that it takes, roughly; the longest are started first
    run: Callable[[Setting], Measured]  # measures

    @property
    def name(self) -> str:
        """Name of its function."""
        return self.run.__name__

    @property
    def paper(self) -> str:
        """Name of the paper's package."""
        return self.run.__module__.split(".")[2]

    def folder(self, out: Path) -> Path:
        """Return the folder of its data."""
        return out / self.paper / self.name

    def command(self, quick: bool) -> str:
        """Return the command that runs it alone."""
        quickly = ["--quick"] if quick else []
        return shlex.join(["python", "-m", "eval.papers", "--only", self.name, *quickly])


def experiment(
    title: str, about: str, minutes: float = 1.0
) -> Callable[[Callable[[Setting], Measured]], Experiment]:
    """Make a function an experiment; see `Experiment`."""
    return lambda run: Experiment(title, " ".join(about.split()), minutes, run)


def row(rows: Sequence[Numbers], **values: Any) -> Numbers:
    """Return the row of a result that has these values."""
    return next(found for found in rows if found.items() >= values.items())


def curves(
    rows: Sequence[Numbers], by: str, colours: Mapping[str, int], what: str, scale: float = 1.0
) -> list[tuple[str, int, np.ndarray]]:
    """Return what rows have, one curve for each name that they have under `by`.

    Args:
        rows: in the order of the abscissae; or one for each curve, which has them all.
        by: "law", or what else there is a curve for.
        colours: of the names.
        what: is drawn; None where there is nothing.
        scale: of the values.
    """
    of = {name: [found[what] for found in rows if found[by] == name] for name in colours}
    return [(n, c, scale * np.array(of[n], float).ravel()) for n, c in colours.items()]


def named(values: Mapping[str, Any], form: Callable[[Any], str]) -> str:
    """Write what goes by several names, as "name: value, name: value"."""
    return ", ".join(f"{name}: {form(value)}" for name, value in values.items())


def fate(fell: float | None) -> str:
    """Say whether a robot stayed up; `fell` is when it fell, s."""
    return "stays up" if fell is None else f"falls at {fell:.1f} s"


_PARTS = (
    *(figures.bars, figures.lines, figures.panel, figures.polar, logged),
    *(html.frames, html.video, number, percent, curves, fate, named, row),
)
_FOR_SECTIONS: Numbers = {part.__name__: part for part in _PARTS}
_FOR_SECTIONS["traces"] = partial(figures.lines, dots=False)


def show(name: str, content: Numbers) -> tuple[list[Finding], str]:
    """Fill the template of an experiment: return the findings that it tells, and its section."""
    findings: list[Finding] = []

    def finding(what: str, paper: str, ours: str, target: str = "", holds: bool = True) -> str:
        verdict: Any = ("met" if holds else "missed") if target else "shown"
        what, paper, ours = (Markup(part).unescape() for part in (what, paper, ours))
        findings.append(Finding(what, paper, ours, verdict, target))
        return ""

    section = html.render(f"papers/{name}.html", finding=finding, **_FOR_SECTIONS, **content)
    return findings, section


def perform(experiment: Experiment, out: Path, quick: bool) -> ExperimentRun:
    """Run an experiment and save its numbers and its section."""
    folder, began = experiment.folder(out), time.monotonic()
    numbers, shown = experiment.run(Setting(quick, folder / "progress.json"))
    findings, section = show(experiment.name, numbers | shown)
    run = ExperimentRun(findings, numbers, quick, time.monotonic() - began)
    write(folder / "numbers.json", to_json(msgspec.to_builtins(run)))
    write(folder / "section.html", section)
    return run


def load(experiment: Experiment, out: Path) -> tuple[ExperimentRun, Markup] | None:
    """Read what `perform` saved, its section as HTML; None where it did not run to the end.

    Raises:
        RunError: the files are not what `perform` wrote.
    """
    numbers, section = (experiment.folder(out) / n for n in ("numbers.json", "section.html"))
    if not section.is_file():
        return None
    try:
        return msgspec.convert(read_json(numbers), ExperimentRun), Markup(section.read_text())
    except (msgspec.ValidationError, UnicodeDecodeError) as error:
        raise RunError(f"{numbers.parent}: not of this experiment ({error}).") from error
