"""The time that physics takes inside a simulation."""

import time
from typing import Any

from fbid_gym.envs.simulation import Simulation


class TimedBatch:
    """Stands in for a simulation's MuJoCo batch and adds up the CPU seconds of `step`."""

    def __init__(self, batch: Any) -> None:
        """Wrap `batch`."""
        self._batch = batch
        self.seconds = 0.0

    @classmethod
    def inside(cls, simulation: Simulation) -> "TimedBatch":
        """Time the physics of `simulation` from now on."""
        timed = cls(simulation.batch)
        simulation.batch = timed
        return timed

    def __getattr__(self, name: str) -> Any:
        """Return whatever the batch has."""
        return getattr(self._batch, name)

    def step(self, *args: Any, **kwargs: Any) -> None:
        """Step, timed."""
        start = time.process_time()
        self._batch.step(*args, **kwargs)
        self.seconds += time.process_time() - start
