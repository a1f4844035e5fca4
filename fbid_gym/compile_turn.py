"""Whose turn it is to compile: of processes that need the same, one compiles, the others wait."""

import fcntl
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any

_POLL = 0.05
"""s between looks at a turn that another process has."""

_PATIENCE = 300.0
"""s to wait for another process; whoever has waited that long compiles for itself."""


class Turn:
    """The turn to compile a function: a lock on a file, which the system opens when a process ends.

    So a process that is killed leaves nothing behind that others would wait for. Where no file can
    be written or locked, it is everybody's turn at once.
    """

    def __init__(self, files: Sequence[Path]) -> None:
        """Name the files that may be locked, the best first."""
        self._files = files
        self._held: IO[bytes] | None = None

    def take(self, done: Callable[[], Any], waiting: Callable[[float], None]) -> Any:
        """Wait for the turn; it is kept until `give`, unless something was found or raised.

        Args:
            done: returns what another process may have compiled meanwhile, or None.
            waiting: called again and again with the seconds waited so far.

        Returns:
            What `done` found. None if there is nothing, and it is for the caller to compile.
        """
        file = None if self._held else self._open()
        if file is None:
            return None
        found = None
        try:
            if _locked(file, waiting):
                found = done()
                self._held = file if found is None else None
        finally:
            if self._held is not file:
                file.close()
        return found

    def give(self) -> None:
        """Let the others have it."""
        if self._held is not None:
            self._held.close()
            self._held = None

    def _open(self) -> IO[bytes] | None:
        for file in self._files:
            try:
                file.parent.mkdir(parents=True, exist_ok=True)
                return open(file, "ab")
            except OSError:
                continue
        return None


def _locked(file: IO[bytes], waiting: Callable[[float], None]) -> bool:
    """Lock a file; False if that takes too long, or the file system has no locks."""
    began = time.monotonic()
    while (waited := time.monotonic() - began) < _PATIENCE:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            waiting(waited)
            time.sleep(_POLL)
        except OSError:
            return False
    return False
