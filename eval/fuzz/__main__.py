"""Search for inputs that break what the package promises: `python -m eval.fuzz`."""

import secrets
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from eval.fuzz import arguments, bundles, commands, kills, laws, models, ticks
from eval.fuzz.search import Subject, faults_in, read_case, search
from eval.pages import RELIABILITY_PAGE, splice, spliced
from fbid_gym.checks import check_choices, check_positive
from train.command import run_command

SUBJECTS: dict[str, Subject] = {
    "laws": laws,
    "ticks": ticks,
    "arguments": arguments,
    "models": models,
    "bundles": bundles,
    "commands": commands,
    "kills": kills,
}


@dataclass(frozen=True)
class FuzzConfig:
    """Try random cases of every subject; what fails is shrunk and kept."""

    minutes: float = 5.0
    """Of all subjects together."""
    subjects: tuple[str, ...] = tuple(SUBJECTS)
    """What to try."""
    seed: int = field(default_factory=lambda: secrets.randbelow(10**9))
    """Of the first cases; another one each time, and printed."""
    case: Path | None = None
    """Try nothing but a case that was kept."""
    out: Path = Path("runs/fuzz")
    """Folder for cases that fail."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Put the table into docs/reliability.md."""


def main(config: FuzzConfig) -> int:
    """Search, print, write; the status is 1 if anything failed."""
    if config.case is not None:
        found = faults_in(*read_case(config.case, SUBJECTS))
        print("\n".join(found) or "holds")
        return int(bool(found))
    check_choices("subject", config.subjects, SUBJECTS)
    check_positive(minutes=config.minutes)
    if config.write_docs:
        spliced(RELIABILITY_PAGE, "", "fuzz")  # to know before the work that it can be written
    print(f"seed {config.seed}", flush=True)
    lines = ["| Subject | Cases | With | Failures kept |", "| --- | --- | --- | --- |"]
    seconds, failed = 60.0 * config.minutes / len(config.subjects), False
    for name in config.subjects:
        outcome = search(name, SUBJECTS[name], config.seed, seconds, config.out)
        held = f"{outcome.amount:,} {SUBJECTS[name].UNIT}"
        lines.append(f"| {name} | {outcome.tried:,} | {held} | {len(outcome.failures)} |")
        print(
            f"{name}: {outcome.tried:,} cases, {held}, {len(outcome.failures)} failed", flush=True
        )
        for path in outcome.failures:
            print(f"  python -m eval.fuzz --case {path}", flush=True)
        failed |= bool(outcome.failures)
    if config.write_docs:
        head = f"{config.minutes:g} minutes, seed {config.seed}.\n\n"
        splice(RELIABILITY_PAGE, head + "\n".join(lines), "fuzz")
    return int(failed)


if __name__ == "__main__":
    sys.exit(run_command("eval.fuzz", FuzzConfig, main))
