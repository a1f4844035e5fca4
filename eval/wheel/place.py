"""Where wheel, source archive and the fresh environment lie, and how commands run in that."""

import os
import subprocess
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from fbid_gym.errors import FbidError

ROOT = Path(__file__).resolve().parents[2]

# Root is not held to the modes of files unless it gives these powers up.
_AS_ANYBODY = ("setpriv", "--bounding-set=-dac_override,-dac_read_search", "--")


@dataclass(frozen=True)
class Place:
    """What is checked, and where.

    Attributes:
        out: folder of wheel and source archive.
        folder: temporary, outside the checkout.
        python: interpreter that the environment is made with.
    """

    out: Path
    folder: Path
    python: str

    @cached_property
    def project(self) -> dict[str, object]:
        """Table `project` of pyproject.toml."""
        text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
        return dict(tomllib.loads(text)["project"])

    @property
    def wheel(self) -> Path:
        """The wheel."""
        return self.out / f"fbid_gym-{self.project['version']}-py3-none-any.whl"

    @property
    def sdist(self) -> Path:
        """The source archive."""
        return self.out / f"fbid_gym-{self.project['version']}.tar.gz"

    @property
    def environment(self) -> Path:
        """The fresh virtual environment."""
        return self.folder / "environment"

    @property
    def interpreter(self) -> Path:
        """Its interpreter."""
        return self.environment / "bin" / "python"

    @property
    def home(self) -> Path:
        """What stands for the user's home folder."""
        return self.folder / "home"

    @cached_property
    def package(self) -> Path:
        """The installed package."""
        said = self.run("-c", "import fbid_gym; print(fbid_gym.__path__[0])")
        return Path(said.strip())

    def run(self, *words: str | Path, cwd: str | Path = "/", as_anybody: bool = False) -> str:
        """Run the environment's interpreter, which sees neither checkout nor the user's settings.

        Args:
            words: after the interpreter's name.
            cwd: the folder in which it begins.
            as_anybody: held to the modes of files even if this is root.

        Returns:
            What it printed.

        Raises:
            FbidError: it failed; with the end of what it said.
        """
        keeps = ("PATH", "MUJOCO_GL", "OMP_NUM_THREADS", "LANG")
        variables = {name: os.environ[name] for name in keeps if name in os.environ}
        prefix = _AS_ANYBODY if as_anybody and os.geteuid() == 0 else ()
        return call(
            [*prefix, str(self.interpreter), "-I", *map(str, words)],
            cwd,
            variables | {"HOME": str(self.home)},
        )


class Check(NamedTuple):
    """Something that is to hold.

    Attributes:
        name: in words.
        run: raises an FbidError that says why it does not hold.
    """

    name: str
    run: Callable[[Place], None]


def call(
    command: Sequence[str], cwd: str | Path = ROOT, variables: dict[str, str] | None = None
) -> str:
    """Run a command and return what it printed.

    Raises:
        FbidError: it failed or is not there.
    """
    try:
        done = subprocess.run(command, cwd=cwd, env=variables, capture_output=True, text=True)
    except FileNotFoundError as error:
        raise FbidError(f"{command[0]} is not installed") from error
    if done.returncode != 0:
        raise FbidError(f"{' '.join(command)}: {(done.stdout + done.stderr).strip()[-1500:]}")
    return done.stdout


def expect(true: bool, otherwise: str) -> None:
    """Raise FbidError unless something is true."""
    if not true:
        raise FbidError(otherwise)
