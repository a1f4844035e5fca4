"""Worker threads: off the caller's core, and nothing else is touched."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from fbid_gym.envs.cores import Workers

linux = pytest.mark.skipif(sys.platform != "linux", reason="affinity is Linux's")


@linux
def test_workers_leave_the_caller_s_core_and_the_caller_stays_free() -> None:
    """The caller's own cores do not change; a worker gets a proper, non-empty part of them."""
    workers, mine = Workers(), os.sched_getaffinity(0)
    with ThreadPoolExecutor(1, initializer=workers.enlist) as pool:
        pool.submit(int).result()
        workers.leave_core_of_caller()
        theirs = pool.submit(os.sched_getaffinity, 0).result()
    assert os.sched_getaffinity(0) == mine
    assert theirs and theirs <= mine
    assert len(theirs) == max(len(mine) - 1, 1)


@linux
def test_one_core_is_shared() -> None:
    """A process with a single core keeps its workers on it."""
    mine = os.sched_getaffinity(0)
    workers = Workers()
    with ThreadPoolExecutor(1, initializer=workers.enlist) as pool:
        pool.submit(int).result()
        try:
            os.sched_setaffinity(0, {min(mine)})
            workers.leave_core_of_caller()
        finally:
            os.sched_setaffinity(0, mine)
        theirs = pool.submit(os.sched_getaffinity, 0).result()
    assert theirs == mine
