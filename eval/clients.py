"""Run the examples of docs/clients.md whose libraries are installed, and time them.

python -m eval.clients --write-docs
"""

import ast
import json
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated, Any, NamedTuple

import tyro

from eval.page.docs import DOCS, markdown_table, marks, splice
from fbid_gym.checks import check_choices
from fbid_gym.errors import RunError
from train.command import run_command

CLIENTS_PAGE = DOCS / "clients.md"
_NEEDS = {"rsl_rl": ("rsl-rl-lib", "rsl_rl"), "RLlib": ("ray", "ray.rllib"),
          "CleanRL": ("torch", "torch")}  # fmt: skip
"""Section of the page -> distribution and module, where these have other names."""

_LONGEST = 600.0  # s that an example may take


class Client(NamedTuple):
    """A library, and the example of it on the page."""

    name: str
    distribution: str
    module: str
    code: str

    def lacks(self) -> str:
        """Return why it cannot be run here; "" where it can."""
        done = _python(f"import {self.module}")
        return done.stderr.strip().rpartition("\n")[2] if done.returncode else ""

    def run(self) -> float:
        """Run the example; return frames per second of its last statement, RunError if it fails."""
        done = _python(f"import eval.clients; eval.clients.timed({self.code!r})")
        if done.returncode:
            raise RunError(f"The example of {self.name} fails: {done.stderr.strip()[-2000:]}")
        return float(json.loads(done.stdout.strip().rpartition("\n")[2]))


def clients() -> list[Client]:
    """Return those of the page."""
    text = CLIENTS_PAGE.read_text()
    found = re.findall(r"^## (\S+)\n.*?^```python\n(.*?)^```", text, re.M | re.S)
    made = []
    for name, code in found:
        distribution, module = _NEEDS.get(name, (name, name.replace("-", "_")))
        made.append(Client(name, distribution, module, code))
    return made


def timed(code: str) -> None:
    """Run an example, and print its `frames` per second of its last statement."""
    import time

    *before, last = ast.parse(code).body
    namespace: dict[str, Any] = {"__name__": "__main__"}
    exec(compile(ast.Module(before, []), "example", "exec"), namespace)
    began = time.monotonic()
    exec(compile(ast.Module([last], []), "example", "exec"), namespace)
    print(f"\n{namespace['frames'] / (time.monotonic() - began)}")


def _python(code: str) -> subprocess.CompletedProcess[str]:
    """Run Python in an empty folder."""
    path = f"import sys; sys.path.insert(0, {str(DOCS.parent)!r}); "
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", path + code]
        return subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=_LONGEST, check=False
        )


@dataclass(frozen=True)
class ClientsConfig:
    """Run the examples of docs/clients.md whose libraries are installed, and time them."""

    only: tuple[str, ...] = ()
    """Sections of the page; all by default."""
    write_docs: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Write their rows of the page's table; the others stay."""


def main(config: ClientsConfig) -> None:
    """Print a row for each."""
    known = {client.name: client for client in clients()}
    check_choices("client", config.only, known)
    first, last = marks()
    table = CLIENTS_PAGE.read_text().partition(first)[2].partition(last)[0]
    rows = dict(re.findall(r"^\| (\S+) (\| .* \|)$", table, re.M))
    for name in config.only or known:
        client = known[name]
        if reason := client.lacks():
            print(f"{name} is left out: {reason}")
            continue
        speed = f"{float(f'{client.run():.2g}'):,.0f}"
        cells = _version(client.distribution), _version("gymnasium"), speed
        rows[name] = f"| {' | '.join(cells)} |"
        print(f"| {name} {rows[name]}", flush=True)
    if config.write_docs:
        head = markdown_table(("Library", "Version", "gymnasium", "Frames/s"), (), 3)
        body = [f"| {name} {rows[name]}" for name in known if name in rows]
        splice(CLIENTS_PAGE, "\n".join([head, *body]))


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "?"


if __name__ == "__main__":
    sys.exit(run_command("eval.clients", ClientsConfig, main, about=__doc__))
