"""Curves in time with their exact derivatives, from which motions are composed."""

from typing import NamedTuple

import numpy as np


class Curve(NamedTuple):
    """A quantity at T instants with its first two time derivatives."""

    value: np.ndarray  # (T,) or (T, ...)
    rate: np.ndarray  # the same, per s
    acceleration: np.ndarray  # the same, per s^2

    def plus(self, *others: "Curve") -> "Curve":
        """Return the sum."""
        return Curve(*(np.sum(parts, axis=0) for parts in zip(self, *others, strict=True)))

    def scaled(self, factor: float, offset: float = 0.0) -> "Curve":
        """Return factor * curve + offset."""
        return Curve(factor * self.value + offset, factor * self.rate, factor * self.acceleration)


def cosine(time: np.ndarray, frequency: float, phase: float = 0.0) -> Curve:
    """Return cos(2 pi frequency time + phase); time (T,) s, frequency Hz, phase rad."""
    rate = 2 * np.pi * frequency
    angle = rate * time + phase
    return Curve(np.cos(angle), -rate * np.sin(angle), -(rate**2) * np.cos(angle))


def rise(time: np.ndarray, start: float, end: float) -> Curve:
    """Return a step from 0 at `start` to 1 at `end`, a quintic at rest at both; times (T,) s."""
    duration = end - start
    s = np.clip((time - start) / duration, 0.0, 1.0)
    return Curve(
        s**3 * (10 - 15 * s + 6 * s**2),
        30 * s**2 * (1 - s) ** 2 / duration,
        60 * s * (1 - s) * (1 - 2 * s) / duration**2,
    )
