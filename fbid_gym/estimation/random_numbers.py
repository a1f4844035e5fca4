"""Random numbers inside compiled loops: a generator of two whole numbers for each robot.

L'Ecuyer 1988, "Efficient and portable combined random number generators", CACM 31(6): two
multiplicative generators whose difference has a period of 2.3e18. Whole numbers of 64 bits hold
all of it, so that a robot's generator is a row of an array, is saved like one, and goes on to the
bit; and a robot's numbers do not depend on how many others there are.
"""

import math

import numpy as np

from fbid_gym.compiled import compiled

MODULI = (2147483563, 2147483399)
"""A row's numbers lie from 1 to these less 1."""


def seeded(rng: np.random.Generator) -> np.ndarray:
    """Draw the beginning of a generator: (2,) int64."""
    return np.array([rng.integers(1, modulus) for modulus in MODULI], np.int64)


@compiled
def uniform(generator: np.ndarray) -> float:
    """Return a number between 0 and 1, neither of them; generator (2,) int64 is updated."""
    first = 40014 * generator[0] % 2147483563
    second = 40692 * generator[1] % 2147483399
    generator[0], generator[1] = first, second
    return ((first - second) % 2147483562 + 1) / 2147483563.0


@compiled
def normal_pair(generator: np.ndarray) -> tuple[float, float]:
    """Return two independent numbers of the standard normal distribution (Box and Muller 1958)."""
    size = math.sqrt(-2.0 * math.log(uniform(generator)))
    angle = 2.0 * math.pi * uniform(generator)
    return size * math.cos(angle), size * math.sin(angle)


@compiled
def normal_vector(generator: np.ndarray) -> tuple[float, float, float]:
    """Return three of them."""
    first, second = normal_pair(generator)
    third, _ = normal_pair(generator)
    return first, second, third
