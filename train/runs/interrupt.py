"""Ctrl-C asks a program to stop; it stops where it can be continued."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

# The last where a terminal is closed. Whoever has it ignored, as `nohup` does, wants to go on.
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def stop_requests(announce: Callable[[], None]) -> Iterator[Callable[[], bool]]:
    """Yield a function that tells whether a SIGINT, SIGTERM or SIGHUP came.

    The second one raises KeyboardInterrupt, also a SIGTERM, which would have ended the process at
    once: started work is then cleaned up as after Ctrl-C.

    Only the main thread of a process can do so; elsewhere it stays False.

    Args:
        announce: called once, when a stop is requested.
    """
    requested = False
    before: dict[signal.Signals, Any] = {}

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal requested
        requested = True
        for each, handler in before.items():
            ends = handler is signal.SIG_DFL
            signal.signal(each, signal.default_int_handler if ends else handler)
        announce()

    if threading.current_thread() is threading.main_thread():
        for number in _SIGNALS:
            if number is not signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, handle)
    try:
        yield lambda: requested
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
