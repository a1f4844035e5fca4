"""Checks that the options of several layers share."""

import numpy as np

from fbid_gym.errors import InvalidValueError


def share(**values: float) -> None:
    """Raise an error that names the first value which is not a number of at least 0."""
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0:
            raise InvalidValueError(name, value, "a number of at least 0")


def at_least_zero(**values: float) -> None:
    """Raise an error that names the first value which is not a finite number of at least 0."""
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < np.inf:
            raise InvalidValueError(name, value, "a finite number of at least 0")


def positive(**values: float) -> None:
    """Raise an error that names the first value which is not a positive finite number."""
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < np.inf:
            raise InvalidValueError(name, value, "a positive finite number")
