"""States of environments as named arrays, a row for each: gathered from their parts, given back.

Random generators are whole numbers in them.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fbid_gym.errors import InvalidValueError

Parts = Mapping[str, Mapping[str, np.ndarray]]  # name of a part -> its arrays by name

_LOW = 2**64 - 1
# What the numbers of a generator are at most.
MOST_NUMBERS = np.array([_LOW, _LOW, _LOW, _LOW, 1, 2**32 - 1], np.uint64)


def gathered(parts: Parts) -> dict[str, np.ndarray]:
    """Return copies of all arrays, each under the name of its part and its own."""
    return {f"{part}.{k}": v.copy() for part, arrays in parts.items() for k, v in arrays.items()}


def give_back(parts: Parts, state: Mapping[str, np.ndarray]) -> None:
    """Write what was gathered to the arrays of the parts."""
    for part, arrays in parts.items():
        for name, value in arrays.items():
            value[:] = state[f"{part}.{name}"]


def rows_of(arrays: Mapping[str, np.ndarray], ids: np.ndarray) -> dict[str, np.ndarray]:
    """Return copies of the rows of some robots."""
    return {name: value[ids] for name, value in arrays.items()}


def check_bounds(state: Mapping[str, np.ndarray], most: Mapping[str, Any]) -> None:
    """Raise InvalidValueError for numbers below 0 or above what is most, which look things up."""
    for name, last in most.items():
        value = state.get(name, np.zeros(6, np.uint64))
        if (value < 0).any() or (value > last).any():
            raise InvalidValueError(f"state {name!r}", value, f"from 0 to {last}")


def packed(rng: np.random.Generator) -> list[int]:
    """A PCG64 generator, the kind that Gymnasium makes, as six 64-bit integers."""
    state = dict(rng.bit_generator.state)
    numbers = state["state"]["state"], state["state"]["inc"]
    halves = [half for number in numbers for half in (number >> 64, number & _LOW)]
    return [*halves, state["has_uint32"], state["uinteger"]]


def unpacked(row: np.ndarray) -> np.random.Generator:
    """The generator of a `packed` row."""
    high, low, inc_high, inc_low, has_uint32, uinteger = (int(number) for number in row)
    rng = np.random.Generator(np.random.PCG64())
    rng.bit_generator.state = {
        "bit_generator": "PCG64",
        "state": {"state": high << 64 | low, "inc": inc_high << 64 | inc_low},
        "has_uint32": has_uint32,
        "uinteger": uinteger,
    }
    return rng
