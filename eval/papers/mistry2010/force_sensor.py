"""A force sensor: noise on the contact forces, then a low-pass filter, then a delay.

[M10] III-A: force sensors "are typically noisy and delayed if filtered". Each of the three can be
switched off alone, so that an experiment can say which of them breaks a controller.
"""

import math
from typing import NamedTuple

import numpy as np

Readings = tuple[np.ndarray, ...]
"""What the sensors of N robots remember: the output of the filter, (N, k) N, and before it those
that are on their way, the oldest first."""


class ForceSensor(NamedTuple):
    """A batch of equal force sensors, one per force component.

    White Gaussian noise is added, a first-order low-pass filter follows (exact for a force that is
    constant over a tick), and the result is reported some ticks late. The first measurement fills
    filter and delay, as if the force had been there for long. Through the filter noise keeps
    sqrt((1 - a) / (1 + a)) of its standard deviation, a = exp(-2 pi cutoff_hz / control_hz).
    """

    control_hz: float  # control ticks per second; one measurement a tick
    noise: float = 0.0  # N, standard deviation of a raw sample
    cutoff_hz: float = math.inf
    """Hz, of the continuous filter, 1 / (2 pi time constant); infinity for no filter."""
    delay: int = 0  # ticks, at least 0

    @property
    def kept(self) -> float:
        """Share of its last output in the filter's next one, a in [0, 1)."""
        return math.exp(-2.0 * math.pi * self.cutoff_hz / self.control_hz)

    def measure(
        self, force: np.ndarray, before: Readings | None, generator: np.random.Generator
    ) -> tuple[np.ndarray, Readings]:
        """Return what the sensors report at this tick, (N, k) N, and what to pass to the next.

        Args:
            force: (N, k) N, true.
            before: from the tick before, left as it is; None at the first.
            generator: of the noise; not drawn from where there is none.
        """
        if self.noise > 0.0:
            force = force + generator.normal(0.0, self.noise, force.shape)
        before = before or (force,) * (self.delay + 1)
        now = (*before, force + self.kept * (before[-1] - force))[1:]
        return now[0], now
