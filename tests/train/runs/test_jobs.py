"""Programs side by side: what runs when, what is shown, and what a failure or a stop does."""

import contextlib
import io
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from rich.console import Console

from train.runs import jobs
from train.runs.jobs import Job, Progress, run_jobs


def _console(terminal: bool = False) -> Console:
    return Console(file=io.StringIO(), width=200, force_terminal=terminal)


def _text(console: Console) -> str:
    return console.file.getvalue()  # type: ignore[attr-defined]


def _job(folder: Path, name: str, script: str) -> Job:
    """A program that runs in `folder`, half way as long as it has not said that it is done."""
    done = folder / f"{name} done"
    script = f"import os, time; os.chdir({str(folder)!r}); {script}; open({done.name!r}, 'w')"

    def progress() -> Progress:
        return Progress(1.0, "arrived") if done.exists() else Progress(0.5, "on the way")

    command = (sys.executable, "-c", script)
    return Job(name, command, folder / "logs" / f"{name}.log", progress)


@pytest.mark.slow
@pytest.mark.parametrize("terminal", [False, True])
def test_jobs_run_so_many_at_a_time_and_are_shown(tmp_path, monkeypatch, terminal):
    """Each notes who else is running when it starts and when it ends."""
    monkeypatch.setattr(jobs, "_LINE_SECONDS", 0.0)
    script = (
        "open('{0} runs', 'w'); time.sleep(0.5); "
        "print(sum(n.endswith('runs') for n in os.listdir('.'))); "
        "print(os.environ['OMP_NUM_THREADS']); os.remove('{0} runs')"
    )
    console = _console(terminal)
    every = [_job(tmp_path, name, script.format(name)) for name in "abcde"]
    assert run_jobs(every, 2, console) == []
    told = [job.log.read_text().split() for job in every]
    assert all(int(beside) <= 2 and threads == "1" for beside, threads in told)
    text = _text(console)
    assert "on the way" in text and "50" in text
    assert ("arrived" in text) if terminal else ("e: done, 5 of 5" in text)


def test_jobs_run_side_by_side(tmp_path):
    """Each ends only once it has seen the other; alone it gives up in the end."""
    script = (
        "open('{0} is there', 'w'); "
        "any(os.path.exists('{1} is there') or time.sleep(0.1) for _ in range(600)) or 1 / 0"
    )
    pair = [_job(tmp_path, names[0], script.format(*names)) for names in (("a", "b"), ("b", "a"))]
    assert run_jobs(pair, 2, _console()) == []


def test_a_failure_is_shown_and_stops_the_others(tmp_path):
    console = _console()
    good = _job(tmp_path, "good", "time.sleep(60)")
    bad = _job(tmp_path, "bad", "print('[because]', flush=True); os._exit(3)")
    never = _job(tmp_path, "never", "pass")
    assert run_jobs([good, bad, never], 2, console) == [good, bad, never]
    assert "bad failed with status 3" in _text(console) and "[because]" in _text(console)
    assert "good failed" not in _text(console)
    assert "KeyboardInterrupt" in good.log.read_text() and not never.log.exists()


def test_a_stop_is_passed_on_once_and_starts_no_more(tmp_path):
    save = (
        "\ntry:\n    open('started', 'w'); time.sleep(60)\n"
        "except KeyboardInterrupt:\n    open('saved', 'w'); os._exit(130)\n"
    )
    first, second = _job(tmp_path, "first", ""), _job(tmp_path, "second", "pass")
    script = f"import os, time; os.chdir({str(tmp_path)!r}){save}"
    first = Job(first.name, (sys.executable, "-c", script), first.log, first.progress)

    def interrupt() -> None:
        while not (tmp_path / "started").exists():
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    console = _console()
    with pytest.raises(KeyboardInterrupt):
        run_jobs([first, second], 1, console)
    thread.join()
    assert (tmp_path / "saved").exists() and not second.log.exists()
    assert "Stopping" in _text(console) and "failed" not in _text(console)


RUNNER = """
import sys
from pathlib import Path
from rich.console import Console
from train.runs.jobs import Job, Progress, run_jobs
job = Job('stubborn', (sys.executable, '-c', sys.argv[1]), Path('log'), lambda: Progress(0.0))
run_jobs([job], 1, Console())
"""
BEGIN = "import os, signal, time\nopen('child', 'w').write(str(os.getpid()))\n"
STUBBORN = BEGIN + (
    "signal.signal(signal.SIGINT, signal.SIG_IGN)\nos.rename('child', 'started'); time.sleep(60)"
)
SAVING = BEGIN + (
    "try:\n    os.rename('child', 'started'); time.sleep(60)\n"
    "except KeyboardInterrupt:\n    open('saved', 'w')"
)


@contextlib.contextmanager
def _runner(folder, child):
    """A process that runs a job which has started, and the number of the job's process."""
    runner = subprocess.Popen(
        [sys.executable, "-c", RUNNER, child],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[3])},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # Under nohup, whose children go on, this would be another test.
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )
    try:
        _until((folder / "started").exists)
        yield runner, int((folder / "started").read_text())
    finally:
        runner.kill()


def test_a_second_sigterm_leaves_nothing_behind(tmp_path):
    """What ignores the first, which is passed on as Ctrl-C, ends with the runner."""
    with _runner(tmp_path, STUBBORN) as (runner, child):
        runner.send_signal(signal.SIGTERM)
        assert "Stopping" in runner.stdout.readline()
        assert _lives(child)
        runner.send_signal(signal.SIGTERM)
        runner.communicate(timeout=60)
        assert runner.returncode != 0
        _until(lambda: not _lives(child))


@pytest.mark.parametrize("end", [signal.SIGHUP, signal.SIGKILL])
def test_what_a_runner_began_saves_and_ends_when_it_is_gone(tmp_path, end):
    """A terminal that is closed, and a kill that nothing can answer."""
    with _runner(tmp_path, SAVING) as (runner, child):
        time.sleep(0.2)
        runner.send_signal(end)
        runner.communicate(timeout=60)
        _until(lambda: not _lives(child))
        assert (tmp_path / "saved").exists()


@pytest.mark.parametrize(
    "script", ["os.write(1, b'\\xff no text'); 1 / 0", "os.remove(log); 1 / 0"]
)
def test_a_log_that_cannot_be_read_ends_nobody_else(tmp_path, script):
    log = str(tmp_path / "logs" / "bad.log")
    bad = _job(tmp_path, "bad", script.replace("log)", f"{log!r})"))
    good = _job(tmp_path, "good", "time.sleep(1)")
    console = _console()
    assert run_jobs([bad, good], 2, console, keep_going=True) == [bad]
    assert "good: done, 1 of 2" in _text(console)


def _until(true):
    for _ in range(1200):
        if true():
            return
        time.sleep(0.05)
    raise AssertionError("not within a minute")


def _lives(process):
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"
