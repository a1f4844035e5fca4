"""Threads that stay off their caller's core.

A thread that is woken often and briefly may be placed on the core of the thread that woke it and
stay there, although another core is idle: two threads then take turns instead of running side by
side. Where that happens it halves the speed of a batch for as long as the process lives.
"""

import ctypes
import os
import sys
import threading
from collections.abc import Callable


def _current_core() -> Callable[[], int] | None:
    """The system's function that tells on which core the caller runs; None where there is none."""
    if sys.platform != "linux":
        return None
    try:
        function = ctypes.CDLL(None).sched_getcpu
    except (AttributeError, OSError):
        return None
    function.restype = ctypes.c_int
    return function


_CURRENT_CORE = _current_core()


class Workers:
    """The worker threads of one caller; does nothing where the system offers no way."""

    def __init__(self) -> None:
        """Start without workers."""
        self._threads: list[int] = []
        self._placed: tuple[int, int] = (-1, 0)

    def enlist(self) -> None:
        """Add the calling thread to the workers."""
        self._threads.append(threading.get_native_id())

    def leave_core_of_caller(self) -> None:
        """Let the workers run on all cores of this process but the one of the calling thread."""
        if _CURRENT_CORE is None:
            return
        place = _CURRENT_CORE(), len(self._threads)
        if place == self._placed:
            return
        others = os.sched_getaffinity(0) - {place[0]}
        if others:
            for thread in self._threads:
                os.sched_setaffinity(thread, others)
        self._placed = place
