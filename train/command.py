"""Run a command: its options are a checked dataclass; its end is `exit_status`."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import is_dataclass
from typing import Concatenate, TypeVar

from fbid_gym.__main__ import called
from fbid_gym.exit_status import exit_status
from fbid_gym.options import check_fields
from train.runs.command_line import read_options

Options = TypeVar("Options")


def run_command(
    module: str,
    options: Callable[..., Options],
    work: Callable[Concatenate[Options, ...], int | None],
    given: Sequence[str] | None = None,
    about: str | None = None,
    *,
    told: bool = False,
) -> int:
    """Run a command line, and return the exit status.

    Args:
        module: to run, as `python -m` takes it.
        options: their dataclass.
        work: what to do with them; returns the exit status, None for 0.
        given: the command line after the module. Default: that of this process.
        about: what the help begins with. Default: what the dataclass says of itself.
        told: whether `work` gets the words of the whole command line, too, as `command`.

    Raises:
        SystemExit: by the parser, after the help or a line on what is wrong with an option.
    """

    def asked() -> int | None:
        prog = " ".join(called(module))
        # The examples of the help are run in the same way; a line that is indented stays one.
        line = f"python -m {module} "
        text = about and about.replace(f"\n{line}", f"\n    {prog} ").replace(line, f"{prog} ")
        words = [*called(module), *(sys.argv[1:] if given is None else given)]
        own = read_options(options, prog=prog, args=given, description=text)
        for part in (own, *vars(own).values()):
            if is_dataclass(part):
                check_fields(part)
        return work(own, command=words) if told else work(own)

    return exit_status(asked)
