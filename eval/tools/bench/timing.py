"""Measuring in turns, so that a slow moment of the machine meets all, and what physics takes."""

import time
from collections.abc import Callable, Hashable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from fbid_gym.envs.simulation import Simulation

Key = TypeVar("Key", bound=Hashable)
Clock = Callable[[], float]
"""Returns seconds: of the wall, or of this process (`time.process_time`) where all is on one
thread, so that what else the machine does counts less."""

Measure = Callable[[], ArrayLike]
"""Returns a number, or k of them."""


def in_turns(measures: Mapping[Key, Measure], rounds: int) -> dict[Key, np.ndarray]:
    """Measure every case once a round; every other round runs the cases in reverse.

    Each measure is called once before the first round, too. Returns (rounds,) numbers for each
    name, or (rounds, k) where the measure returns k.
    """
    found: dict[Key, list[ArrayLike]] = {name: [] for name in measures}
    for index in range(-1, rounds):
        for name in list(measures)[:: -1 if index % 2 else 1]:
            found[name].append(measures[name]())
    return {name: np.array(values[1:]) for name, values in found.items()}


class Timed:
    """Stands in for an object and adds up the seconds that one of its methods takes."""

    def __init__(self, inner: Any, method: str, clock: Clock = time.process_time) -> None:
        """Wrap `inner`."""
        self._inner, self._call, self._clock = inner, getattr(inner, method), clock
        self.seconds = 0.0
        setattr(self, method, self._timed)

    def __getattr__(self, name: str) -> Any:
        """Return whatever the object has."""
        return getattr(self._inner, name)

    def _timed(self, *args: Any, **kwargs: Any) -> Any:
        start = self._clock()
        result = self._call(*args, **kwargs)
        self.seconds += self._clock() - start
        return result


def timed_physics(simulation: Simulation, clock: Clock = time.process_time) -> Timed:
    """Time the physics steps of a simulation from now on."""
    timed = Timed(simulation.batch, "step", clock)
    simulation.batch = timed
    return timed


def added(
    start: Callable[[], object], step: Callable[[], object], steps: int, spent: Measure
) -> Measure:
    """Return what says how much a number of steps from a beginning add to what is spent."""

    def run() -> ArrayLike:
        start()
        before = spent()
        for _ in range(steps):
            step()
        return np.subtract(spent(), before)

    return run
