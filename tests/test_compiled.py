"""A kernel whose first arguments are bound is the kernel, on what these arguments hold."""

import gc
import weakref
from typing import NamedTuple

import numpy as np
import pytest

from fbid_gym.compiled import bind, kernel


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
    found = np.empty_like(x)
    for i in range(len(x)):
        found[i] = outer.inner.share * x[i] + outer.inner.values[i] + outer.table[i, outer.count]
        if outer.chosen[i]:
            found[i] += shift + other.share * other.values[i]
        if outer.doubled:
            found[i] *= 2.0
    return Inner(found, outer.inner.share)


@kernel
def add_to(total: np.ndarray, x: np.ndarray) -> None:
    for i in range(len(x)):
        total[i] += x[i]


@pytest.fixture
def outer(rng) -> Outer:
    return Outer(
        count=2,
        inner=Inner(rng.normal(size=5), rng.normal()),
        chosen=rng.random(5) < 0.5,
        doubled=bool(rng.random() < 0.5),
        table=rng.normal(size=(5, 3)),
    )


def test_bound_and_handed_over_is_the_same(outer, rng):
    rest = rng.normal(), rng.normal(size=5), Inner(rng.normal(size=5), rng.normal())
    expected = combine(outer, *rest)
    for number in range(1, 5):
        first, others = (outer, *rest)[:number], (outer, *rest)[number:]
        found = bind(combine, *first)(*others)
        assert isinstance(found, Inner) and found.share == expected.share
        np.testing.assert_array_equal(found.values, expected.values)


def test_arrays_are_seen_as_they_are_and_numbers_as_they_were(outer, rng):
    rest = 0.0, rng.normal(size=5), Inner(np.zeros(5), 0.0)
    bound = bind(combine, outer)
    before = bound(*rest).values
    outer.inner.values[:] += 1.0
    np.testing.assert_allclose(bound(*rest).values - before, 1.0 + outer.doubled, rtol=1e-12)
    np.testing.assert_array_equal(bound(*rest).values, combine(outer, *rest).values)


def test_what_is_bound_can_be_written_to():
    total = np.zeros(3)
    add = bind(add_to, total)
    add(np.arange(3.0))
    add(np.ones(3))
    np.testing.assert_array_equal(total, [1.0, 2.0, 3.0])


def test_what_is_bound_is_kept(rng):
    values = rng.normal(size=100_000)
    bound = bind(combine, Outer(0, Inner(values.copy(), 0.0), values > 0, False, np.zeros((1, 1))))
    # The last array is too small for all but the first robot; only that is asked for.
    gc.collect()
    np.full(100_000, np.nan)
    found = bound(0.0, np.ones(1), Inner(np.zeros(1), 0.0)).values
    np.testing.assert_array_equal(found, values[:1])


def test_each_binding_has_arrays_of_its_own():
    totals = np.zeros(2), np.zeros(2)
    adds = [bind(add_to, total) for total in totals]
    adds[0](np.ones(2))
    np.testing.assert_array_equal(totals, [[1.0, 1.0], [0.0, 0.0]])
    assert len(add_to.entries) == 2  # itself, and one for all bindings


@pytest.mark.parametrize(
    "array", [np.zeros((3, 2))[:, 0], np.zeros(3, np.float32), np.zeros(3, complex)]
)
def test_what_compiled_code_would_read_wrongly_is_not_bound(array):
    with pytest.raises(AssertionError, match="total is not C-contiguous, or of none of .*float64"):
        bind(add_to, array)


def test_what_is_no_longer_used_is_given_back_at_once(rng):
    """Not by the collector, which does not see how large the arrays are."""
    values = rng.normal(size=5)
    bound, kept = bind(add_to, values), weakref.ref(values)
    bound(np.ones(5))
    gc.disable()
    try:
        del values, bound
        assert kept() is None
    finally:
        gc.enable()
