"""Trainings that are killed at any moment and started again: each ends in the same numbers.

Signal 9 leaves a process no time for anything: what it was writing stays half written.
"""

import functools
import sys
import tempfile
import time
from contextlib import redirect_stderr, redirect_stdout
from multiprocessing import get_context
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from train.runs.folder import RunFolder
from train.runs.tables import read_rows

_MOST_SECONDS = 120.0
# Checkpoints are frequent, so that some kills fall into the writing of one.
_TRAINING = [
    *("--env", "fbid_gym/QuadrupedBalance-v0", "--action-layer", "torque"),
    *("--env-args", '{"episode_seconds": 0.4, "push_force": [0, 0]}'),
    *("--total-steps", "960", "--num-envs", "4", "--num-threads", "1"),
    *("--ppo.n-steps", "16", "--ppo.batch-size", "64", "--ppo.n-epochs", "1", "--ppo.hidden", "8"),
    *("--eval.every", "320", "--eval.episodes", "2", "--checkpoint-every", "64"),
]
_WALL = ("wall_seconds", "fps")
_SEEDS = (0, 1)


class _Straight(NamedTuple):
    """A training that nobody killed."""

    seconds: float
    """From its beginning on."""
    numbers: dict[str, Any]


@pytest.mark.long_search
@settings(deadline=None)
@given(st.sampled_from(_SEEDS), st.lists(st.floats(0.0, 1.0), min_size=1, max_size=3))
def test_kills(seed: int, kills: list[float]) -> None:
    """Kills are shares of the time that the training takes."""
    straight = _straight(seed)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place, "run")
        for share in kills:
            training = _begun(folder, seed)
            training.join(share * straight.seconds)
            training.kill()
            training.join()
        training = _begun(folder, seed)
        training.join(_MOST_SECONDS)
        training.kill()
        assert training.exitcode == 0, _said(folder).read_text()
        numbers = _numbers(folder)
        different = [name for name, value in numbers.items() if value != straight.numbers[name]]
        assert different == []


@functools.cache
def _straight(seed: int) -> _Straight:
    with tempfile.TemporaryDirectory() as place:
        folder, training = Path(place, "run"), _begun(Path(place, "run"), seed)
        began = time.monotonic()
        training.join(_MOST_SECONDS)
        return _Straight(time.monotonic() - began, _numbers(folder))


def _begun(folder: Path, seed: int) -> BaseProcess:
    """Start or continue a training, and wait until it has begun, or has nothing left to do."""
    events = RunFolder.of(folder).tensorboard  # a file for each time that it is started
    before = len(list(events.glob("*")))
    training = _trainings().Process(target=_train, args=(folder, seed))
    training.start()
    while len(list(events.glob("*"))) == before and training.is_alive():
        time.sleep(0.01)
    return training


@functools.cache
def _trainings() -> ForkServerContext:
    """What starts processes that have imported already what trains, which takes longest."""
    context = get_context("forkserver")
    context.set_forkserver_preload(["train.ppo"])
    return context


def _train(folder: Path, seed: int) -> None:
    """The command line of `train.ppo`, in a process of its own."""
    from train.training import command_line  # torch: those who search have no use for it

    words = [*_TRAINING, "--seed", str(seed), "--out", str(folder)]
    sys.argv = ["train.ppo", *words]
    with _said(folder).open("w") as said, redirect_stdout(said), redirect_stderr(said):
        status = command_line("ppo")
    sys.exit(status)


def _said(folder: Path) -> Path:
    return folder.with_suffix(".log")


def _numbers(path: Path) -> dict[str, Any]:
    """What has to be the same: name -> value."""
    folder = RunFolder.of(path)
    found: dict[str, Any] = {
        table.name: [
            {name: value for name, value in row.items() if name not in _WALL}
            for row in read_rows(table)
        ]
        for table in (folder.progress, folder.evaluations)
    }
    policies = (folder.policy, folder.best_policy)
    return found | {policy.name: policy.read_bytes() for policy in policies}
