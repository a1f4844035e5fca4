"""Checks that the environments' arguments share: each returns a plain value or raises one error."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fbid_gym.errors import InvalidValueError


def whole_number(name: str, value: Any) -> int:
    """Return a positive whole number, which may be given as a float."""
    if _is_number(value) and value > 0 and float(value).is_integer():
        return int(value)
    raise InvalidValueError(name, value, "a positive whole number")


def non_negative(name: str, value: Any) -> int:
    """Return a whole number of at least 0, which may be given as a float."""
    if _is_number(value) and value >= 0 and float(value).is_integer():
        return int(value)
    raise InvalidValueError(name, value, "a whole number of at least 0")


def number(name: str, value: Any, expected: str = "a number") -> float:
    """Return a finite number."""
    if _is_number(value) and np.isfinite(value):
        return float(value)
    raise InvalidValueError(name, value, expected)


def pair(name: str, value: Any) -> tuple[float, float]:
    """Return two finite numbers."""
    expected = "a pair (least, most) of numbers"
    if isinstance(value, str) or not np.iterable(value):
        raise InvalidValueError(name, value, expected)
    numbers = list(value)
    if len(numbers) != 2 or not all(_is_number(x) and np.isfinite(x) for x in numbers):
        raise InvalidValueError(name, value, expected)
    return float(numbers[0]), float(numbers[1])


def by_name(name: str, value: Any) -> dict[str, Any]:
    """Return arguments given by name; none for None."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise InvalidValueError(name, value, "a dictionary from names to values, or None")
    return dict(value)


def _is_number(value: Any) -> bool:
    kinds = int | float | np.integer | np.floating
    return isinstance(value, kinds) and not isinstance(value, bool)
