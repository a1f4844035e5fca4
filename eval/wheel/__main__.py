"""Build wheel and source archive, and check them in a fresh environment: `make dist`.

python -m eval.wheel --python python3.13

Each check is printed with its result; the exit status is 1 when one fails. The environment lies in
a temporary folder outside the checkout. It installs what the wheel needs, in the versions of
constraints.txt, and compiles: that takes some minutes.
"""

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from eval.wheel import archives, environment
from eval.wheel.place import ROOT, Check, Place
from fbid_gym.errors import FbidError
from train.command import run_command

CHECKS: tuple[Check, ...] = (*archives.CHECKS, *environment.CHECKS)


@dataclass(frozen=True)
class WheelConfig:
    """Build wheel and source archive, and check them in a fresh environment."""

    out: Path = Path("dist")
    """Folder of the two files."""
    python: str = sys.executable
    """Interpreter of the environment: 3.11 or newer, with venv."""
    build: bool = True
    """Whether to build them; else those in the folder are checked."""


def build(out: Path) -> None:
    """Build the source archive, and the wheel from that.

    Raises:
        FbidError: it could not be built.
    """
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(ROOT)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise FbidError(f"The wheel could not be built: {(done.stdout + done.stderr)[-2000:]}")


def failures(place: Place, checks: Sequence[Check]) -> int:
    """Print each check with its result; return how many failed."""
    failed = 0
    for check in checks:
        try:
            check.run(place)
        except FbidError as error:
            failed += 1
            print(f"FAILED  {check.name}\n        {error}", flush=True)
        else:
            print(f"ok      {check.name}", flush=True)
    return failed


def run(config: WheelConfig) -> int:
    """Build if that is asked for, and check; return the exit status."""
    out = config.out.resolve()
    if config.build:
        build(out)
    with tempfile.TemporaryDirectory(prefix="fbid_gym-") as folder:
        place = Place(out, Path(folder).resolve(), config.python)
        print(f"{place.wheel}\n{place.sdist}", flush=True)
        return int(failures(place, CHECKS) > 0)


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    return run_command("eval.wheel", WheelConfig, run, arguments, __doc__)


if __name__ == "__main__":
    sys.exit(main())
