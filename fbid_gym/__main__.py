"""The commands of the package: `fbid-gym COMMAND`, or `python -m fbid_gym COMMAND`.

Those of `train/` and `eval/` are no part of the package: a checkout has these folders beside it, a
built wheel in `fbid_gym_programs/`. A command finds them because that folder joins the path of its
own process and of its children, and of no other: nothing is installed under the names `train` and
`eval`.
"""

import os
import runpy
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fbid_gym.checks import check_choices
from fbid_gym.errors import FbidError
from fbid_gym.exit_status import exit_status

_PACKAGE = Path(__file__).resolve().parent
PROGRAM = "fbid-gym"
"""The name of the command."""


@dataclass(frozen=True)
class Subcommand:
    """The module that a subcommand runs."""

    module: str
    """Run as the main program; it reads the command line and ends the process."""
    about: str
    """One line of the help."""
    extra: str = ""
    """Extra of the package that brings what it needs; empty where the package itself does."""


COMMANDS = {
    "play": Subcommand("eval.play", "Push a walking robot in the browser.", "play"),
    "demo": Subcommand("eval.demo", "Train two layers with two seeds, compare them.", "train"),
    "train": Subcommand("train.ppo", "Train a policy with PPO.", "train"),
    "eval": Subcommand("eval.rollout", "Play a policy, print what it did, film it.", "train"),
    "compare": Subcommand("eval.compare", "Compare trainings: one page.", "train"),
    "benchmark": Subcommand("eval.layers", "Compare an action layer of yours with ours.", "train"),
    "export": Subcommand("eval.export", "Write a policy for others: ONNX, the Hub.", "export"),
    "transfer": Subcommand("eval.transfer", "Play policies on robots they never saw.", "train"),
    "engines": Subcommand("eval.engines", "See who walks in Bullet as well.", "bullet"),
    "robots": Subcommand("fbid_gym.robots", "Show what is understood of a robot, let it walk."),
    "policies": Subcommand("fbid_gym.policy", "List the policies that come with the package."),
    "sac": Subcommand("train.sac", "Train a policy with SAC.", "train"),
    "crossq": Subcommand("train.crossq", "Train a policy with CrossQ.", "train"),
    "sweep": Subcommand("train.sweep", "Run every training of a study.", "train"),
    "study": Subcommand("eval.study", "Evaluate the trainings of a study: one page.", "train"),
    "robustness": Subcommand("eval.robustness", "See what policies were not trained for.", "train"),
    "zero-actions": Subcommand("eval.zero_actions", "Let robots act without a policy.", "train"),
    "papers": Subcommand("eval.papers", "Run the papers' experiments: one page.", "train"),
}
"""Name of a command -> what it runs."""


def called(module: str) -> tuple[str, ...]:
    """Return the words with which the user of this process runs a module."""
    names = {command.module: name for name, command in COMMANDS.items()}
    if sys.argv[0].startswith(f"{PROGRAM} ") and module in names:
        return PROGRAM, names[module]
    return "python", "-m", module


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit status, 2 on errors."""
    return exit_status(lambda: _run(list(sys.argv[1:] if arguments is None else arguments)))


def _run(given: list[str]) -> None:
    if not given or given[0] in ("-h", "--help"):
        lines = [f"usage: {PROGRAM} COMMAND [OPTIONS]", "", "Commands:"]
        lines += [f"  {name:<14}{command.about}" for name, command in COMMANDS.items()]
        lines += ["", f"{PROGRAM} COMMAND --help shows the options of a command."]
        print("\n".join(lines))
        return
    name, *rest = given
    check_choices("command", [name], COMMANDS)
    command = COMMANDS[name]
    installed = _PACKAGE.parent / "fbid_gym_programs"
    folder = str(installed if installed.is_dir() else _PACKAGE.parent)
    sys.path.insert(0, folder)
    paths = folder, os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
    os.environ["PYTHONSAFEPATH"] = "1"  # or children would take `train/` of the current folder
    sys.argv = [f"{PROGRAM} {name}", *rest]
    try:
        runpy.run_module(command.module, run_name="__main__")
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if not command.extra or missing in ("fbid_gym", "train", "eval"):
            raise
        raise FbidError(
            f"{PROGRAM} {name} needs {missing}, which is not installed. It comes with the extra "
            f"{command.extra!r}: pip install 'fbid_gym[{command.extra}]'."
        ) from error


if __name__ == "__main__":
    sys.exit(main())
