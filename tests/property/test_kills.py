"""Trainings that are killed at any moment and started again: each ends in the same numbers.

Signal 9 leaves a process no time for anything: what it was writing stays half written.
"""

import contextlib
import functools
import subprocess
import sys
import tempfile
import time
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
            _ended(_begun(folder, seed), share * straight.seconds)
        assert _ended(_begun(folder, seed), _MOST_SECONDS) == 0, _said(folder).read_text()
        numbers = _numbers(folder)
        different = [name for name, value in numbers.items() if value != straight.numbers[name]]
        assert different == []


@functools.cache
def _straight(seed: int) -> _Straight:
    with tempfile.TemporaryDirectory() as place:
        folder, training = Path(place, "run"), _begun(Path(place, "run"), seed)
        began = time.monotonic()
        _ended(training, _MOST_SECONDS)
        return _Straight(time.monotonic() - began, _numbers(folder))


def _begun(folder: Path, seed: int) -> subprocess.Popen[bytes]:
    """Start or continue a training, and wait until it has begun, or has nothing left to do."""
    events = RunFolder.of(folder).tensorboard  # a file for each time that it is started
    before = len(list(events.glob("*")))
    words = [*_TRAINING, "--seed", str(seed), "--out", str(folder)]
    with _said(folder).open("w") as said:
        command = [sys.executable, "-m", "train.ppo", *words]
        training = subprocess.Popen(command, stdout=said, stderr=said)
    while len(list(events.glob("*"))) == before and training.poll() is None:
        time.sleep(0.01)
    return training


def _ended(training: subprocess.Popen[bytes], seconds: float) -> int:
    """Status of a training that is killed after so many seconds."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        training.wait(seconds)
    training.kill()
    return training.wait()


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
