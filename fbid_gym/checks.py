"""Checks at the boundary: each raises one error that names the value and what was expected."""

import sys
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from fbid_gym.errors import InvalidValueError, NonFiniteError, ShapeError, UnknownOptionError


def number(name: str, value: Any, expected: str = "a number") -> float:
    """Return a finite number."""
    if _is_finite(value):
        return float(value)
    raise InvalidValueError(name, value, expected)


def by_name(name: str, value: Any, known: Iterable[str] | None = None) -> dict[str, Any]:
    """Return arguments given by name, `known` ones where these are told; none for None."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise InvalidValueError(name, value, "a dictionary from names to values, or None")
    if known is not None:
        check_choices(name, value, known)
    return dict(value)


def check_choices(kind: str, values: Iterable[str], choices: Iterable[str]) -> None:
    """Raise an error that names the first value which is not among the choices."""
    known = tuple(choices)
    for value in values:
        if value not in known:
            raise UnknownOptionError(kind, value, known or ("none",))


def positive_numbers(name: str, value: Any, *sizes: int) -> np.ndarray:
    """Return positive finite numbers, as many as one of `sizes`."""
    expected = " or ".join(str(size) for size in sizes) + " positive finite numbers"
    numbers = np.atleast_1d(real_numbers(name, value, expected)).astype(float, copy=False)
    valid = numbers.ndim == 1 and len(numbers) in sizes
    if not valid or not ((numbers > 0.0) & (numbers < np.inf)).all():
        raise InvalidValueError(name, value, expected)
    return numbers


def check_plain(name: str, value: Any) -> None:
    """Raise InvalidValueError where JSON would hold a named tuple, as `Falling`, as a mere list."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            check_plain(f"{name}.{key}", item)
    elif isinstance(value, tuple) and hasattr(value, "_fields"):
        raise InvalidValueError(name, value, "numbers, text, lists or mappings: what JSON can hold")


def check_positive(**values: Any) -> None:
    """Raise an error that names the first value which is not a positive finite number."""
    for name, value in values.items():
        if not _is_finite(value) or value <= 0:
            raise InvalidValueError(name, value, "a positive finite number")


def real_numbers(name: str, value: Any, expected: str) -> np.ndarray:
    """Return an array of real numbers or truth values, of whatever shape; itself if it is one.

    Text that spells numbers, complex numbers, objects and masked entries are none.
    """
    try:
        array = np.asarray(value)
    except Exception:  # of a ragged list, or of an object's own __array__
        raise InvalidValueError(name, value, expected) from None
    if array.dtype.kind not in "fiub" or np.ma.is_masked(value):
        raise InvalidValueError(name, value, expected)
    return array


def check_shape(name: str, array: np.ndarray, expected: tuple[int, ...], axes: str) -> None:
    """Raise ShapeError unless `array` has the expected shape; `axes` names them, as "(N, nv)"."""
    if tuple(array.shape) != expected:
        raise ShapeError(name, tuple(array.shape), f"{axes} = {expected}")


def check_finite(name: str, array: np.ndarray) -> None:
    """Raise NonFiniteError that names the first entry which is NaN or infinite."""
    if not np.isfinite(array).all():
        raise NonFiniteError(name, tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0]))


def contiguous(array: np.ndarray) -> np.ndarray:
    """Return the array in float64, C-contiguous and writable; itself if it is that already.

    Compiled code of its own is made for arrays that may not be written, which takes half a minute.
    """
    own = np.ascontiguousarray(array, np.float64)
    return own if own.flags.writeable else own.copy()


def is_number(value: Any) -> bool:
    """Return whether a value is a real number that a float can hold; True and False are none."""
    if isinstance(value, int) and not isinstance(value, bool):
        return abs(value) <= sys.float_info.max
    return isinstance(value, float | np.integer | np.floating)


def _is_finite(value: Any) -> bool:
    return is_number(value) and bool(abs(value) <= sys.float_info.max)
