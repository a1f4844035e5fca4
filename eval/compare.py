r"""Compare action layers: runs in, one HTML page out.

python -m eval.compare runs/a-s0 runs/a-s1 runs/b-s0 runs/b-s1 --out report.html
"""

import sys
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.markup import escape

from eval.comparison import compare, film
from eval.report import headline, page
from eval.results import Settings
from train.command import run_command
from train.environments import register
from train.runs.files import check_output, to_json, write
from train.runs.reading import load
from train.runs.robots import chosen


@dataclass(frozen=True)
class CompareConfig:
    """Compare action layers: runs in, one HTML page out, and its numbers as JSON beside it."""

    runs: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Run folders, exported policies or `shipped:NAME`, all of one environment."""
    out: Path = Path("report.html")
    """The page. Its numbers go into a file of the same name ending in .json."""
    register: tuple[str, ...] = ()
    """Modules to import first, which register environments of yours."""
    robot: str | None = None
    """Play all on this one: a built-in robot, an MJCF, a URDF, a robot.toml or a robot.zip."""
    feet: tuple[str, ...] = ()
    """Of your own robot: names of bodies, sites or spheres, or '{"left": ["heel", "toe"]}'."""
    settings: Annotated[Settings, tyro.conf.arg(name="")] = field(default_factory=Settings)
    """How to compare."""


def run(config: CompareConfig, command: list[str]) -> None:
    """Compare, then write the page and its numbers."""
    console = Console()
    check_output(config.out, "out", (".html", ".htm"))
    register(config.register)
    robot = chosen(config.robot, config.feet)
    runs = [load(path, robot) for path in config.runs]
    with console.status("comparing") as status:

        def say(what: str) -> None:
            status.update(escape(what))

        comparison = compare(runs, config.settings, say)
        clips = None
        if config.settings.video_seconds > 0:
            clips = film(runs, comparison, say)
        status.update("writing")
        html = page(comparison, clips, command)
    write(config.out.with_suffix(".json"), to_json(asdict(comparison)))
    write(config.out, html)
    for warning in comparison.warnings:
        console.print(f"warning: {warning}", style="yellow", markup=False, highlight=False)
    console.print(headline(comparison), markup=False, highlight=False)
    console.print(f"wrote {config.out}", markup=False, highlight=False)


main = partial(run_command, "eval.compare", CompareConfig, run, about=__doc__, told=True)


if __name__ == "__main__":
    sys.exit(main())
