"""Random numbers inside compiled loops: a generator of two whole numbers for each robot.

Vigna 2017, "Further scramblings of Marsaglia's xorshift generators", Journal of Computational and
Applied Mathematics 315: xorshift128+, with a period of 2^128 - 1. Of its sums the upper 52 bits are
taken, without what the lower ones carry over: so signed numbers of 64 bits hold all of it, and a
robot's generator is a row of an array, is saved like one, and goes on to the bit. A robot's numbers
do not depend on how many others there are.

Marsaglia and Tsang 2000, "The ziggurat method for generating random variables", Journal of
Statistical Software 5(8): normal numbers, for a fifth of what logarithms and sines cost.
"""

import math

import numpy as np

from fbid_gym.compiled import compiled

_BITS = (1 << 52) - 1
_UNIT = 2.0**-52

_LAYERS = 128
_TAIL, _AREA = 3.442619855899, 9.91256303526217e-3  # where it begins, and that of each layer
_TRIES = 100  # rows of zeros, as a file may hold, are no generator, and must not go on for ever


def seeded(rng: np.random.Generator) -> np.ndarray:
    """Draw the beginning of a generator: (2,) int64, not both 0."""
    return rng.integers(1, 1 << 62, 2)


@compiled
def _bits(generator: np.ndarray) -> int:
    """Return 52 random bits; generator (2,) int64 is updated."""
    first, second = generator[0], generator[1]
    found = ((first >> 12) & _BITS) + ((second >> 12) & _BITS)
    first ^= first << 23
    first ^= second ^ ((first >> 18) & ((1 << 46) - 1)) ^ ((second >> 5) & ((1 << 59) - 1))
    generator[0], generator[1] = second, first
    return found & _BITS


@compiled
def uniform(generator: np.ndarray) -> float:
    """Return a number between 0 and 1, neither of them; generator (2,) int64 is updated."""
    return (_bits(generator) + 0.5) * _UNIT


def _layers() -> tuple[np.ndarray, np.ndarray]:
    """Compute where each layer ends, outermost first, and the bell's height there."""
    ends = np.zeros(_LAYERS + 1)
    ends[0], ends[1] = _AREA / math.exp(-0.5 * _TAIL**2), _TAIL
    for k in range(2, _LAYERS):
        ends[k] = math.sqrt(
            -2.0 * math.log(_AREA / ends[k - 1] + math.exp(-0.5 * ends[k - 1] ** 2))
        )
    return ends, np.exp(-0.5 * ends**2)


_END, _HEIGHT = _layers()


@compiled
def normal(generator: np.ndarray) -> float:
    """Return a number of the standard normal distribution; generator (2,) int64 is updated."""
    found = 0.0
    for _ in range(_TRIES):
        bits = _bits(generator)
        layer, side = bits % _LAYERS, (bits // _LAYERS + 0.5) * (2.0 * _LAYERS * _UNIT) - 1.0
        found = side * _END[layer]
        if abs(found) < _END[layer + 1]:
            return found
        if layer == 0:
            return math.copysign(_beyond(generator), side)
        low, high = _HEIGHT[layer], _HEIGHT[layer + 1]
        if low + (high - low) * uniform(generator) < math.exp(-0.5 * found * found):
            return found
    return found


@compiled
def _beyond(generator: np.ndarray) -> float:
    """Return a number of the tail (Marsaglia 1964)."""
    beyond = 0.0
    for _ in range(_TRIES):
        beyond = -math.log(uniform(generator)) / _TAIL
        if -2.0 * math.log(uniform(generator)) > beyond * beyond:
            break
    return _TAIL + beyond
