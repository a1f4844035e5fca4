r"""Write the results of a study: a table, pages of docs/, and one page with all of it.

python -m eval.study studies/walking.toml --out report.html

`train.sweep` trains what a study names; this reads the run folders. What has not finished is shown
as far as it is, and said to be unfinished.
"""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from eval.page.docs import DOCS, splice, spliced
from eval.robustness.arms import PlayedArm, arm_of_cells
from eval.robustness.curves import Budget, Robustness, measure, read
from eval.robustness.factors import FACTORS
from eval.rollout import Player
from eval.study import fresh
from eval.study.cells import policy_digest, robustness_file
from eval.study.films import Clips, film
from eval.study.findings import checked_reference, findings
from eval.study.page import page
from eval.study.results import Settings
from eval.study.tables import drawn, table
from fbid_gym.errors import InvalidValueError, RunError
from fbid_gym.options import Number, Whole
from train.command import run_command
from train.progress import progress
from train.runs.files import check_output, to_json, write
from train.runs.study import Study, arms, check_cells, environment_name, read_study


@dataclass(frozen=True)
class StudyConfig:
    """Print the table of a study; write its page, and its pages of docs/."""

    study: tyro.conf.Positional[Path]
    """TOML file, see `train.runs.study`."""
    runs: Path | None = None
    """Folder of the runs; by default the one that the study names, or runs/NAME."""
    out: Path | None = None
    """The page, in HTML. Its numbers go into a file of the same name ending in .json."""
    reference: str | None = None
    """Arm that the others are set against. Default: the study's."""
    video_seconds: Annotated[float, Number(0.0, 600.0, "s")] = 6.0
    """Length of the page's clips, s. 0: none."""
    robustness: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Measure first how the policies stand what they were not trained for, as eval.robustness does,
    and keep it beside the runs. What is kept there is shown without being asked for."""
    robustness_episodes: Annotated[int, Whole(1, 65_536)] = 32
    """At every value, for every run."""
    robustness_seconds: Annotated[float, Number(0.1, 10_000.0, "s")] = 10.0
    """Length of these episodes, s."""
    fresh_episodes: Annotated[int, Whole(1, 65_536)] | None = None
    """Play first, by every finished policy that has not, so many episodes that neither training nor
    its evaluations have seen, and keep what they did beside the runs. It is shown without being
    asked for. Policies that learn nothing are played here, and nowhere else."""
    settings: Annotated[Settings, tyro.conf.arg(name="")] = field(default_factory=Settings)
    """How the runs are put together."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Write the curves to docs/NAME.svg, after the study's name, and the table between its marks
    into the study's page of docs/."""


def main(config: StudyConfig, command: Sequence[str] = ()) -> int:
    """Read, print, write; return the exit status."""
    console = Console(width=200, highlight=False)
    study = read_study(config.study, config.runs)
    check_cells(study)
    checked_reference(study, config.reference)
    docs = DOCS / f"{study.page}.md"
    check_output(config.out, "out", (".html", ".htm"))
    if config.out is None and config.robustness:
        raise InvalidValueError("--robustness", True, "--out beside it, which shows it")
    if config.write_docs:
        spliced(docs, "", study.name)  # refuses a page without marks before anything is played
    if config.fresh_episodes is not None:
        with progress(console, "fresh episodes") as tell:
            fresh.measure(study, config.fresh_episodes, tell)
    said = table(study)
    pictures = {}
    if config.write_docs:  # refuses before anything is written
        pictures = {".svg": drawn(study)}
    if config.out is not None:
        found = findings(study, config.settings, config.reference)
        if config.robustness:
            measure_robustness(config, study, console)
        robustness = {env_id: kept for env_id in found.environments()
                      if (kept := _kept(study, env_id)) is not None}  # fmt: skip
        old = [warning for kept in robustness.values() for warning in _outdated(study, kept)]
        found = replace(found, warnings=[*found.warnings, *old])
        clips = Clips()
        if config.video_seconds > 0:
            cells = {cell.config.folder.name: cell for cell in (*study.cells, *study.unlearnt)}
            with progress(console, "clips") as tell:
                clips, missing = film(
                    found, lambda name: Player.of_cell(cells[name]), config.video_seconds, tell
                )
            found = replace(found, warnings=[*found.warnings, *missing])
        write(config.out.with_suffix(".json"), to_json(asdict(found)))
        write(config.out, page(found, clips, robustness, shlex.join(command)))
    for suffix, content in pictures.items():
        write(DOCS / f"{study.name}{suffix}", content)
    if config.write_docs:
        splice(docs, said, study.name)
    console.print(said, markup=False)
    if config.out is not None:
        console.print(f"wrote {config.out}", markup=False)
    return 0


def measure_robustness(config: StudyConfig, study: Study, console: Console) -> None:
    """Try the policies of each environment along all factors, and keep what is found."""
    tried: dict[str, list[PlayedArm]] = {}
    for arm in arms(study):
        done = arm.finished()
        if done:
            short = {"episode_seconds": config.robustness_seconds}
            tried.setdefault(arm.env, []).append(arm_of_cells(arm.name, done, None, short))
    budget = Budget(config.robustness_episodes, config.settings.seed)
    for env_id, its in tried.items():
        with progress(console, f"robustness in {env_id}") as tell:
            found = measure(its, FACTORS, budget, tell)
        write(robustness_file(study, env_id), to_json(found.to_dict()))


def _kept(study: Study, env_id: str) -> Robustness | None:
    """Return the robustness that is kept beside the runs; None where there is none.

    Raises:
        RunError: it is no such thing, or of another environment or of other runs.
    """
    file = robustness_file(study, env_id)
    if not file.is_file():
        return None
    kept = read(file)
    own = {(cell.arm, cell.config.folder.name) for cell in (*study.cells, *study.unlearnt)}
    strangers = {(arm, run) for arm in kept.arms for run in kept.runs.get(arm) or ["none"]} - own
    if kept.env_id != env_id or strangers:
        whose = "arm {}, run {}".format(*min(strangers)) if strangers else kept.env_id
        raise RunError(f"{file}: is of {whose}. Expected {env_id} and runs of the study.")
    return kept


def _outdated(study: Study, kept: Robustness) -> list[str]:
    """Warn where the policies that were tried are not those of today, or are not known."""
    cells = {cell.config.folder.name: cell for cell in study.cells}
    learnt = {arm: runs for arm, runs in kept.runs.items() if cells.keys() >= {*runs}}
    what = f"What the policies stand in {environment_name(kept.env_id)}"
    again = "--robustness measures it anew."
    if any(len(kept.policies.get(arm, ())) != len(runs) for arm, runs in learnt.items()):
        return [f"{what} was measured before it was noted of which policies: {again}"]
    changed = [
        run
        for arm, runs in learnt.items()
        for run, then in zip(runs, kept.policies[arm], strict=True)
        if then != policy_digest(cells[run])
    ]
    said = f"{what} is of policies that have changed since, of {', '.join(changed)}: {again}"
    return [said] if changed else []


if __name__ == "__main__":
    sys.exit(run_command("eval.study", StudyConfig, main, about=__doc__, told=True))
