"""Random generators as whole numbers, so that they can be saved beside arrays."""

import numpy as np

_LOW = 2**64 - 1
MOST_NUMBERS = np.array([_LOW, _LOW, _LOW, _LOW, 1, 2**32 - 1], np.uint64)
"""What the numbers of one are at most."""


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
