"""Jobs on the machines of a Ray cluster, all of which see the same files.

Every machine runs the same command lines in the same folder as this one would, so the checkout, its
environment and the run folders lie on storage that all of them see. A machine that is lost takes
its jobs with it; they begin again on another one, and a training goes on from its checkpoint.
"""

import logging
import signal
import socket
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fbid_gym.errors import RunError
from train.runs.jobs import ONE_CORE, Job, Start

AUTO = "auto"
"""The address of the cluster that this machine is of."""

_FREE_SECONDS = 180.0
"""Within which a run folder is free again whose machine was lost."""
_ANSWER_SECONDS = 10.0
_STOPPED = 128 + signal.SIGINT


@contextmanager
def cluster(address: str, folder: Path) -> Iterator[tuple[Start, int]]:
    """Yield a function that starts jobs on a cluster, and its number of cores.

    Args:
        address: of its head, such as "10.0.0.1:6379", or `AUTO`.
        folder: that the jobs write into; every machine has to see it.

    Raises:
        RunError: Ray is not installed, nobody answers, or a machine does not see the folder.
    """
    try:
        import ray
    except ImportError:
        raise RunError(
            "--ray takes Ray, which is not installed: pip install -e .[ray] -c constraints.txt"
        ) from None
    _check_answer(address)
    try:
        ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
    except Exception as error:  # of many kinds, some of them its own
        reason = str(error).strip().splitlines() or [type(error).__name__]
        raise RunError(f"No Ray cluster answers at {address!r}: {reason[0]}") from error
    try:
        _check_storage(ray, folder)
        yield _start_on(ray), int(ray.cluster_resources().get("CPU", 0)) or 1
    finally:
        ray.shutdown()


def _check_answer(address: str) -> None:
    """Raise a RunError if nobody answers, which takes Ray itself minutes to say."""
    host, _, port = address.rpartition(":")
    if address == AUTO or "://" in address:
        return
    try:
        socket.create_connection((host, int(port)), timeout=_ANSWER_SECONDS).close()
    except (OSError, ValueError, OverflowError) as error:
        raise RunError(
            f"No Ray cluster answers at {address!r}: {error}. Expected the address of its head, "
            f"such as 10.0.0.1:6379, or {AUTO!r}."
        ) from error


class _Remote:
    """A job on some machine of a cluster, with the methods that `run_jobs` needs of a process."""

    def __init__(self, ray: Any, submit: Callable[[float], Any]) -> None:
        """Submit it; `submit` takes how long to wait for a folder that is in use, s."""
        self._ray, self._submit = ray, submit
        self._status: int | None = None
        self._stopped = False
        self._result = submit(0.0)

    def poll(self) -> int | None:
        """Return its exit status once it has ended; begin it anew where its machine was lost."""
        if self._status is None and self._ray.wait([self._result], timeout=0)[0]:
            errors = self._ray.exceptions
            try:
                self._status = self._ray.get(self._result)
            except errors.TaskCancelledError:
                self._status = _STOPPED
            except errors.RayTaskError:  # the machine cannot begin it
                self._status = 1
            except errors.RayError:
                if self._stopped:
                    self._status = _STOPPED
                else:
                    self._result = self._submit(_FREE_SECONDS)
        return self._status

    def send_signal(self, number: int) -> None:
        """Ask it to stop where it can be continued."""
        self._stopped = True
        self._ray.cancel(self._result, force=False)

    def terminate(self) -> None:
        """End it."""
        if self._status is None:
            self._stopped = True
            self._ray.cancel(self._result, force=True)


def _start_on(ray: Any) -> Start:
    here, one_core = str(Path.cwd()), ONE_CORE

    # Within a function, so that it is sent as it is: workers import nothing of ours.
    def run(command: tuple[str, ...], log: str, patience: float) -> int:
        import ctypes
        import os
        import signal
        import subprocess
        import time

        def begin() -> None:
            # A killed worker cannot stop the processes that it has started.
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)
            # Workers block it, and processes that they start would inherit that.
            signal.pthread_sigmask(signal.SIG_SETMASK, ())
            signal.signal(signal.SIGINT, signal.default_int_handler)

        os.makedirs(os.path.dirname(log), exist_ok=True)
        until = time.monotonic() + patience
        while True:
            with open(log, "wb") as output:
                process = subprocess.Popen(
                    command,
                    cwd=here,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    env={**os.environ, **one_core},
                    start_new_session=True,
                    preexec_fn=begin,
                )
            try:
                # A wait without an end would not hear that it is cancelled.
                while (status := process.poll()) is None:
                    time.sleep(0.2)
            except KeyboardInterrupt:
                process.send_signal(signal.SIGINT)
                return process.wait()
            # 2: refused. The folder may still be held by whom a lost machine left behind.
            if status != 2 or time.monotonic() > until:
                return status
            time.sleep(5.0)

    remote = ray.remote(run).options(num_cpus=1, max_retries=0)

    def start(job: Job) -> _Remote:
        log = str(job.log.absolute())
        return _Remote(ray, lambda patience: remote.remote(job.command, log, patience))

    return start


def _check_storage(ray: Any, folder: Path) -> None:
    """Raise a RunError for a machine that cannot write the folder and begin this Python."""
    strategy = ray.util.scheduling_strategies.NodeAffinitySchedulingStrategy

    def sees(mark: str, python: str) -> bool:
        import os

        writes = os.access(os.path.dirname(mark), os.W_OK)
        return os.path.isfile(mark) and writes and os.access(python, os.X_OK)

    look = ray.remote(sees)
    folder.mkdir(parents=True, exist_ok=True)
    machines = [node for node in ray.nodes() if node["Alive"]]
    with tempfile.NamedTemporaryFile(dir=folder.absolute(), prefix=".seen-") as mark:
        asked = [
            look.options(num_cpus=0, scheduling_strategy=strategy(node["NodeID"], soft=False))
            for node in machines
        ]
        answers = ray.get([one.remote(mark.name, sys.executable) for one in asked])
    for node, seen in zip(machines, answers, strict=True):
        if not seen:
            raise RunError(
                f"Machine {node['NodeManagerAddress']} of the cluster cannot write to "
                f"{folder.absolute()} and begin {sys.executable}. Expected storage that all "
                "machines share."
            )
