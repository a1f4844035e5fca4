"""Parts of compiled code answer as plain functions do, and are optimised only with their kernel."""

from typing import NamedTuple

import numpy as np
from numba import typeof
from numba.core.codegen import JITCodeLibrary
from numba.core.runtime import rtsys
from numba.core.runtime._nrt_python import memsys_enable_stats

from fbid_gym.compiled import compiled, kernel


class Pair(NamedTuple):
    low: np.ndarray
    high: np.ndarray


@kernel
def ends(x: np.ndarray) -> Pair:
    low, high = np.empty_like(x), np.empty_like(x)
    for i in range(len(x)):
        low[i], high[i] = min(x[i], 0.0), max(x[i], 0.0)
    return Pair(low, high)


@compiled
def _highest(pair: Pair, first: int) -> float:
    """Makes no array: it looks at a view of one."""
    best, row = pair.high[first], pair.high[first:]
    for i in range(len(row)):
        best = max(best, row[i])
    return best


@compiled
def _widest(pair: Pair) -> float:
    """Makes an array, and is given others by a kernel, which is a part here."""
    wide, found = np.empty(len(pair.low)), ends(pair.low)
    for i in range(len(wide)):
        wide[i] = pair.high[i] - pair.low[i] + 0.0 * found.low[i]
    return _highest(Pair(wide, wide), 0)


@compiled
def _chosen(pair: Pair, places: np.ndarray) -> float:
    """Makes a copy of what it chooses."""
    return pair.high[places].sum()


@kernel
def summary(pair: Pair, places: np.ndarray) -> np.ndarray:
    return np.array([_highest(pair, 1), _widest(pair), _chosen(pair, places)])


PAIR = Pair(np.array([0.0, 1.0, 2.0]), np.array([9.0, 3.0, 5.0]))
PLACES = np.array([0, 2])


def test_only_what_python_calls_is_optimised(monkeypatch):
    names = []
    optimise = JITCodeLibrary._optimize_final_module
    monkeypatch.setattr(
        JITCodeLibrary,
        "_optimize_final_module",
        lambda library: [names.append(library.name), optimise(library)],
    )
    np.testing.assert_array_equal(summary(PAIR, PLACES), [5.0, 9.0, 14.0])
    ours = [name for name in names if name.strip("_") in ("summary", "ends", "widest", "chosen")]
    assert ours == ["summary"]


def test_python_may_call_a_part_and_a_kernel_that_others_call():
    assert _highest(PAIR, 1) == 5.0
    np.testing.assert_array_equal(ends(np.array([-3.0, 0.25])).low, [-3.0, 0.0])


def test_what_parts_make_is_given_back():
    memsys_enable_stats()
    kept = []
    for _ in range(3):
        summary(PAIR, PLACES)
        stats = rtsys.get_allocation_stats()
        kept.append(stats.alloc - stats.free)
    assert kept[0] == kept[1] == kept[2]


def _code_of(function, *arguments):
    """What Numba makes of a part for what calls it with such arguments."""
    kinds = tuple(typeof(value) for value in arguments)
    function.part.compile(kinds)
    return str(function.part.overloads[kinds].library._final_module)


def test_only_parts_that_make_arrays_count_references():
    assert "define" in _code_of(_highest, PAIR, 0) and "NRT_" not in _code_of(_highest, PAIR, 0)
    assert "NRT_incref" in _code_of(_widest, PAIR)
    assert "NRT_" in _code_of(_chosen, PAIR, PLACES)
