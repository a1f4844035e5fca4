"""Checks at the boundary: each raises one error that names the value and what was expected."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from fbid_gym.errors import InvalidValueError, ShapeError, UnknownOptionError


def number(name: str, value: Any, expected: str = "a number") -> float:
    """Return a finite number."""
    if _is_number(value) and np.isfinite(value):
        return float(value)
    raise InvalidValueError(name, value, expected)


def whole_number(name: str, value: Any) -> int:
    """Return a positive whole number, which may be given as a float."""
    if _is_number(value) and value > 0 and float(value).is_integer():
        return int(value)
    raise InvalidValueError(name, value, "a positive whole number")


def count(name: str, value: Any) -> int:
    """Return a whole number of at least 0, which may be given as a float."""
    if _is_number(value) and value >= 0 and float(value).is_integer():
        return int(value)
    raise InvalidValueError(name, value, "a whole number of at least 0")


def flag(name: str, value: Any) -> bool:
    """Return True or False."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise InvalidValueError(name, value, "True or False")


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


def check_choices(kind: str, values: Iterable[str], choices: Iterable[str]) -> None:
    """Raise an error that names the first value which is not among the choices."""
    known = tuple(choices)
    for value in values:
        if value not in known:
            raise UnknownOptionError(kind, value, known)


def positive_numbers(name: str, value: Any, *sizes: int) -> np.ndarray:
    """Return positive finite numbers, as many as one of `sizes`."""
    expected = " or ".join(str(size) for size in sizes) + " positive finite numbers"
    try:
        numbers = np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        raise InvalidValueError(name, value, expected) from None
    valid = numbers.ndim == 1 and len(numbers) in sizes
    if not valid or not ((numbers > 0.0) & (numbers < np.inf)).all():
        raise InvalidValueError(name, value, expected)
    return numbers


def check_positive(**values: Any) -> None:
    """Raise an error that names the first value which is not a positive finite number."""
    for name, value in values.items():
        if not _is_number(value) or not 0 < value < np.inf:
            raise InvalidValueError(name, value, "a positive finite number")


def check_at_least_zero(**values: Any) -> None:
    """Raise an error that names the first value which is not a finite number of at least 0."""
    for name, value in values.items():
        if not _is_number(value) or not 0 <= value < np.inf:
            raise InvalidValueError(name, value, "a finite number of at least 0")


def check_share(**values: Any) -> None:
    """Raise an error that names the first value which is not a number of at least 0."""
    for name, value in values.items():
        if not _is_number(value) or not value >= 0:
            raise InvalidValueError(name, value, "a number of at least 0")


def check_shape(name: str, array: np.ndarray, expected: tuple[int, ...], axes: str) -> None:
    """Raise ShapeError unless `array` has the expected shape; `axes` names them, as "(N, nv)"."""
    if tuple(array.shape) != expected:
        raise ShapeError(name, tuple(array.shape), f"{axes} = {expected}")


def contiguous(array: np.ndarray) -> np.ndarray:
    """Return the array in float64, C-contiguous; itself if it is that already."""
    return np.ascontiguousarray(array, np.float64)


def _is_number(value: Any) -> bool:
    kinds = int | float | np.integer | np.floating
    return isinstance(value, kinds) and not isinstance(value, bool)
