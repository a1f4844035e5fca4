"""How every command ends."""

import sys
from collections.abc import Callable

from fbid_gym.errors import FbidError


def exit_status(work: Callable[[], int | None]) -> int:
    """Do the work of a command and return its exit status; an error is one line, and status 2."""
    try:
        return work() or 0
    except FbidError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
