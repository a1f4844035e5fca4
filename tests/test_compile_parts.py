"""Parts of compiled code answer as plain functions do, and are optimised only with their kernel."""

from typing import NamedTuple

import numpy as np
import pytest
from numba import typeof
from numba.core.codegen import JITCodeLibrary
from numba.core.runtime import rtsys
from numba.core.runtime._nrt_python import (
    memsys_disable_stats,
    memsys_enable_stats,
    memsys_stats_enabled,
)

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


@compiled
def _highest(pair: Pair, first: int) -> float:
    """Makes no array: it looks at a view of one."""
    best, row = pair.high[first], pair.high[first:]
    for i in range(len(row)):
        best = max(best, row[i])
    return best


@compiled
def _widest(pair: Pair) -> float:
    """Makes one, and is given others."""
    wide, sorted_ends = np.empty(len(pair.low)), _sorted_ends(pair.low)
    for i in range(len(wide)):
        wide[i] = pair.high[i] - pair.low[i] + 0.0 * sorted_ends.low[i]
    return _highest(Pair(wide, wide), 0)


@compiled
def _chosen(pair: Pair, places: np.ndarray) -> float:
    """Makes a copy of what it chooses."""
    return pair.high[places].sum()


@kernel
def summary(pair: Pair, places: np.ndarray) -> np.ndarray:
    return np.array([_highest(pair, 1), _widest(pair), _chosen(pair, places)])


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
    monkeypatch.setattr(spread.entry._cache, "_places", ())
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
    assert _between.part.overloads and _between(-3.0, 0.0, 1.0) == 0.0


def test_what_parts_make_is_given_back():
    pair = Pair(np.array([0.0, 1.0, 2.0]), np.array([9.0, 3.0, 5.0]))
    places = np.array([0, 2])
    kept, enabled = [], memsys_stats_enabled()
    memsys_enable_stats()
    try:
        for _ in range(3):
            np.testing.assert_array_equal(summary(pair, places), [5.0, 9.0, 14.0])
            stats = rtsys.get_allocation_stats()
            kept.append(stats.alloc - stats.free)
    finally:
        if not enabled:
            memsys_disable_stats()
    assert kept[0] == kept[1] == kept[2]


def _code_of(part, *arguments):
    """What Numba makes of a part for what calls it with such arguments."""
    kinds = tuple(typeof(value) for value in arguments)
    part.part.compile(kinds)
    return str(part.part.overloads[kinds].library._final_module)


def test_only_parts_that_make_arrays_count_references():
    pair = Pair(np.array([0.0, 1.0]), np.array([9.0, 3.0]))
    assert "define" in _code_of(_highest, pair, 0) and "NRT_" not in _code_of(_highest, pair, 0)
    assert "NRT_incref" in _code_of(_widest, pair)
    assert "NRT_" in _code_of(_chosen, pair, np.array([0]))
