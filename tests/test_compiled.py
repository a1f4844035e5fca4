"""Named tuples cross the door of a kernel as their fields, and come out as they went in."""

import inspect
import os
import pickle
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest
from numba.core.runtime import rtsys
from numba.core.runtime._nrt_python import memsys_enable_stats

from fbid_gym.compiled import compiled, kernel


class Inner(NamedTuple):
    values: np.ndarray
    share: float


class Outer(NamedTuple):
    count: int
    inner: Inner
    chosen: np.ndarray
    doubled: bool
    table: np.ndarray


@kernel
def combine(outer: Outer, shift: float, x: np.ndarray, other: Inner) -> Inner:
    """Return x, scaled and shifted."""
    found = np.empty_like(x)
    for i in range(len(x)):
        found[i] = outer.inner.share * x[i] + outer.inner.values[i] + outer.table[i, outer.count]
        if outer.chosen[i]:
            found[i] += shift + other.share * other.values[i]
        if outer.doubled:
            found[i] *= 2.0
    return Inner(found, outer.inner.share)


@pytest.fixture
def arguments(rng):
    inner, table = Inner(rng.normal(size=5), rng.normal()), rng.normal(size=(5, 3))
    outer = Outer(2, inner, chosen=rng.random(5) < 0.5, doubled=True, table=table)
    return outer, rng.normal(), rng.normal(size=5), Inner(rng.normal(size=5), rng.normal())


def test_a_kernel_returns_what_its_function_does(arguments):
    expected, found = combine.__wrapped__(*arguments), combine(*arguments)
    assert isinstance(found, Inner) and found.share == expected.share
    np.testing.assert_allclose(found.values, expected.values, rtol=1e-12)


def test_a_kernel_can_be_looked_at_and_pickled_as_a_function():
    assert combine.__doc__ == "Return x, scaled and shifted."
    assert list(inspect.signature(combine).parameters) == ["outer", "shift", "x", "other"]
    assert pickle.loads(pickle.dumps(combine)) is combine


IN_PYTHON = """
import numpy as np
from fbid_gym.actions import LAYERS
from fbid_gym.small_matrices import dot
from tests.batches import started
from tests.postures import without

assert type(dot).__name__ == "function"
body = ("base_acceleration", "com_wrench")
todo = [("biped", layer) for layer in LAYERS]
todo += [(without("quadruped", "hip_roll"), layer) for layer in body]
todo += [(without("g1", "hip_yaw"), layer) for layer in body]
for robot, layer in todo:
    sensors = "mems" if layer == "com_wrench" else "perfect"
    given = {"robot": robot, "task": "walk", "action_layer": layer, "sensors": sensors}
    batch = started(given, 1)
    for _ in range(6):
        batch.step(np.random.default_rng(0).uniform(-1, 1, (1, len(batch.action_names))))
print("done")
"""


@pytest.mark.slow
def test_without_compilation_everything_runs_in_python():
    """Compiled code reads and writes beyond the end of an array without a word; Python refuses."""
    command, python = [sys.executable, "-c", IN_PYTHON], os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, env=python, capture_output=True, text=True)
    assert done.stdout.split() == ["done"], done.stderr


@compiled
def _highest(inner: Inner, first: int) -> float:
    """Makes no array: it looks at a view of one."""
    best, row = inner.values[first], inner.values[first:]
    for i in range(len(row)):
        best = max(best, row[i])
    return best


@compiled
def _widest(inner: Inner) -> float:
    """Makes an array, and copies of others."""
    wide = np.empty(len(inner.values))
    for i in range(len(wide)):
        wide[i] = inner.values[i] - inner.share
    return _highest(Inner(wide, 0.0), 0) + wide[np.array([0, 2])].sum()


@kernel
def summary(inner: Inner) -> np.ndarray:
    return np.array([_highest(inner, 1), _widest(inner)])


def test_parts_answer_as_in_python_and_what_they_make_is_given_back():
    inner, kept = Inner(np.array([9.0, 3.0, 5.0]), 1.0), []
    assert _highest(inner, 1) == 5.0
    memsys_enable_stats()
    for _ in range(3):
        np.testing.assert_array_equal(summary(inner), [5.0, 20.0])
        stats = rtsys.get_allocation_stats()
        kept.append(stats.alloc - stats.free)
    assert kept[0] == kept[1] == kept[2]
