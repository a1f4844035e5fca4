"""Options that know nothing of each other, in pairs: environments, layers, robots, settings."""

from collections.abc import Iterable
from typing import Any


def pairs(first: Iterable[Any], second: Iterable[Any], each: int = 2) -> list[tuple[Any, ...]]:
    """Each of the first with so many of the second, all of which stand in turn.

    A value that is a tuple adds all its parts to the row.
    """
    first, second = list(first), list(second)
    assert each * len(first) >= len(second), "some of the second would stand in no row"
    return [
        (*_parts(one), *_parts(second[(each * i + k) % len(second)]))
        for i, one in enumerate(first)
        for k in range(each)
    ]


def _parts(value: Any) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else (value,)
