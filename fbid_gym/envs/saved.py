"""States of environments as named arrays, a row for each: gathered from their parts, given back."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fbid_gym.errors import InvalidValueError

Parts = Mapping[str, Mapping[str, np.ndarray]]
"""Name of a part -> its arrays by name."""


def gathered(parts: Parts) -> dict[str, np.ndarray]:
    """Return copies of all arrays, each under the name of its part and its own."""
    return {f"{part}.{k}": v.copy() for part, arrays in parts.items() for k, v in arrays.items()}


def give_back(parts: Parts, state: Mapping[str, np.ndarray]) -> None:
    """Write what was gathered to the arrays of the parts."""
    for part, arrays in parts.items():
        for name, value in arrays.items():
            value[:] = state[f"{part}.{name}"]


def under(prefix: str, state: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the arrays of one part."""
    start = prefix + "."
    return {k.removeprefix(start): v for k, v in state.items() if k.startswith(start)}


def rows_of(arrays: Mapping[str, np.ndarray], ids: np.ndarray) -> dict[str, np.ndarray]:
    """Return copies of the rows of some robots."""
    return {name: value[ids] for name, value in arrays.items()}


def check_bounds(state: Mapping[str, np.ndarray], most: Mapping[str, Any]) -> None:
    """Raise InvalidValueError for numbers below 0 or above what is most, which look things up."""
    for name, last in most.items():
        value = state.get(name, np.zeros(6, np.uint64))
        if (value < 0).any() or (value > last).any():
            raise InvalidValueError(f"state {name!r}", value, f"from 0 to {last}")
