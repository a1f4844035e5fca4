"""Exit status of every command."""

import os
import select
import sys
from collections.abc import Callable

from fbid_gym.errors import FbidError

_INTERRUPTED, _UNREAD = 130, 141


def exit_status(work: Callable[[], int | None]) -> int:
    """Do the work of a command and return its exit status.

    An error of ours is one line, and status 2; so is a file that cannot be read or written. What
    Ctrl-C ended has the status that a shell gives to it, and so has what is no longer read: `head`
    has seen enough.
    """
    try:
        try:
            return work() or 0
        finally:  # also where `--help` ends it
            sys.stdout.flush()
    except FbidError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        if isinstance(error, BrokenPipeError) and _unread():
            return _UNREAD
        what = f"{error.filename}: " if error.filename is not None else ""
        print(f"error: {what}{error.strerror or error}.", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return _INTERRUPTED


def _unread() -> bool:
    """Whether nobody reads our standard output; then what is left of it goes nowhere."""
    try:
        look = select.poll()
        look.register(sys.stdout.fileno(), 0)
        broken = any(event & select.POLLERR for _, event in look.poll(0))
    except (AttributeError, OSError):  # no poll on Windows, or an output that is no file
        return False
    if broken:
        # Python flushes once more at its end, and would complain of the same.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return broken
