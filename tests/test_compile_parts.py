"""Parts of compiled code answer as plain functions do, and are optimised only with their kernel."""

from typing import NamedTuple

import numpy as np
import pytest
from numba.core.codegen import JITCodeLibrary

from fbid_gym.compiled import compiled, kernel


class Pair(NamedTuple):
    low: np.ndarray
    high: np.ndarray


@compiled
def _between(x, low, high):
    return min(max(x, low), high)


@compiled
def _sorted_ends(x: np.ndarray) -> Pair:
    low, high = np.empty_like(x), np.empty_like(x)
    for i in range(len(x)):
        low[i], high[i] = _between(x[i], -1.0, 0.0), _between(x[i], 0.0, 1.0)
    return Pair(low, high)


@kernel
def ends(x: np.ndarray) -> Pair:
    return _sorted_ends(x)


@kernel
def spread(x: np.ndarray) -> np.ndarray:
    """A kernel in a kernel is a part, too."""
    found = ends(x)
    return found.high - found.low


@pytest.fixture
def optimised(monkeypatch):
    """Names of the libraries that Numba optimises as a whole."""
    names = []
    optimise = JITCodeLibrary._optimize_final_module

    def recorded(library):
        names.append(library.name)
        optimise(library)

    monkeypatch.setattr(JITCodeLibrary, "_optimize_final_module", recorded)
    return names


def test_only_what_python_calls_is_optimised(optimised, monkeypatch):
    monkeypatch.setattr(spread.entry, "_cache", type(spread.entry._cache)(spread.entry.py_func, ()))
    x = np.array([-3.0, -0.5, 0.25, 7.0])
    np.testing.assert_array_equal(spread(x), [1.0, 0.5, 0.25, 1.0])
    ours = [name for name in optimised if any(n in name for n in ("spread", "ends", "_between"))]
    assert len(ours) == 1 and "spread" in ours[0], ours


def test_a_kernel_that_others_call_can_be_called_itself():
    found = ends(np.array([-3.0, 0.25]))
    np.testing.assert_array_equal(found.low, [-1.0, 0.0])
    np.testing.assert_array_equal(found.high, [0.0, 0.25])


def test_python_may_call_a_part():
    """As tests do; before, and after, it became part of something."""
    assert _between(3.0, 0.0, 1.0) == 1.0
    np.testing.assert_array_equal(_sorted_ends(np.array([-0.5])).low, [-0.5])
    assert _between.overloads and _between(-3.0, 0.0, 1.0) == 0.0
