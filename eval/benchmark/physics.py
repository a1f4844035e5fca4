"""The time that physics takes inside a simulation."""

import time
from collections.abc import Callable
from typing import Any

from fbid_gym.envs.simulation import Simulation


class TimedBatch:
    """Stands in for a simulation's MuJoCo batch and adds up the seconds of `step`."""

    def __init__(self, batch: Any, clock: Callable[[], float]) -> None:
        """Wrap `batch`."""
        self._batch, self._clock = batch, clock
        self.seconds = 0.0

    @classmethod
    def inside(
        cls, simulation: Simulation, clock: Callable[[], float] = time.process_time
    ) -> "TimedBatch":
        """Time the physics of `simulation` from now on."""
        timed = cls(simulation.batch, clock)
        simulation.batch = timed
        return timed

    def __getattr__(self, name: str) -> Any:
        """Return whatever the batch has."""
        return getattr(self._batch, name)

    def step(self, *args: Any, **kwargs: Any) -> None:
        """Step, timed."""
        start = self._clock()
        self._batch.step(*args, **kwargs)
        self.seconds += self._clock() - start
