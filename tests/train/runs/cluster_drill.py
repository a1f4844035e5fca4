"""A cluster of three machines on this one; one is lost. Run by test_cluster.py, which reads it.

A process of its own: Ray's warnings and threads are not those of the tests.
"""

import io
import json
import signal
import sys
import threading
import time
from pathlib import Path

from ray.cluster_utils import Cluster
from rich.console import Console

from fbid_gym.errors import RunError
from train.runs.cluster import cluster
from train.runs.jobs import Job, Progress, run_jobs

COUNTS = """
import pathlib, time
begun, count = pathlib.Path("{0} begun"), pathlib.Path("{0} count")
begun.write_text(begun.read_text() + "x" if begun.exists() else "x")
start = int(count.read_text()) if count.exists() else 0
for step in range(start + 1, 31):
    time.sleep(0.1)
    count.write_text(str(step))
"""
SAVES = """
import pathlib, time
try:
    pathlib.Path("waits").touch()
    time.sleep(60.0)
except KeyboardInterrupt:
    pathlib.Path("saved").touch()
"""


def main(folder: Path) -> dict[str, object]:
    """Lose a machine amid two jobs; stop one; see one fail; look for a folder in vain."""

    def job(name: str, script: str) -> Job:
        command = (sys.executable, "-c", f"import os; os.chdir({str(folder)!r})\n{script}")
        return Job(name, command, folder / "logs" / name, lambda: Progress(0.5))

    def reached(name: str) -> bool:
        count = folder / f"{name} count"
        return count.exists() and int(count.read_text() or 0) >= 5

    def until(said) -> None:  # type: ignore[no-untyped-def]
        end = time.monotonic() + 120.0
        while not said() and time.monotonic() < end:
            time.sleep(0.05)

    found: dict[str, object] = {}
    machines = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
    lost, _ = machines.add_node(num_cpus=1), machines.add_node(num_cpus=1)
    machines.wait_for_nodes()

    def lose() -> None:
        until(lambda: reached("a") and reached("b"))
        machines.remove_node(lost, allow_graceful=False)

    with cluster(machines.address, folder) as (start, cores):
        found["cores"] = cores
        threading.Thread(target=lose).start()
        jobs = [job(name, COUNTS.format(name)) for name in "ab"]
        failed = run_jobs(jobs, cores, Console(file=io.StringIO()), start=start)
        found["failed"] = [one.name for one in failed]
        found["counts"] = [(folder / f"{name} count").read_text() for name in "ab"]
        found["begun"] = sorted(len((folder / f"{name} begun").read_text()) for name in "ab")

        stopped = start(job("stopped", SAVES))
        until((folder / "waits").exists)
        stopped.send_signal(signal.SIGINT)
        until(lambda: stopped.poll() is not None)
        found["saved"] = (folder / "saved").exists()

        wrong = start(job("wrong", "raise SystemExit(3)"))
        until(lambda: wrong.poll() is not None)
        found["status"] = wrong.poll()
    python, sys.executable = sys.executable, "/nowhere/python"
    try:
        with cluster(machines.address, folder):
            pass
    except RunError as error:
        found["blind"] = str(error)
    sys.executable = python
    machines.shutdown()
    return found


if __name__ == "__main__":
    place = Path(sys.argv[1])
    (place / "found.json").write_text(json.dumps(main(place)))
