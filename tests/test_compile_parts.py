"""Parts of compiled code answer as plain functions do, and give back what they make."""

from typing import NamedTuple

import numpy as np
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


def test_a_kernel_answers_as_its_parts_would_in_python():
    np.testing.assert_array_equal(summary(PAIR, PLACES), [5.0, 9.0, 14.0])


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
