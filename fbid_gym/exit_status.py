"""How every command ends."""

import sys
from collections.abc import Callable

from fbid_gym.errors import FbidError

_INTERRUPTED = 130


def exit_status(work: Callable[[], int | None]) -> int:
    """Do the work of a command and return its exit status.

    An error of ours is one line, and status 2; so is a file that cannot be read or written. What
    Ctrl-C ended has the status that a shell gives to it.
    """
    try:
        return work() or 0
    except FbidError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        what = f"{error.filename}: " if error.filename is not None else ""
        print(f"error: {what}{error.strerror or error}.", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return _INTERRUPTED
