"""What a force sensor reports of contact forces: noise, then a low-pass filter, then a delay.

[M10] III-A: force sensors "are typically noisy and delayed if filtered". Each of the three can be
switched off alone, so that an experiment can say which of them breaks a controller.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.checks import check_shape
from fbid_gym.errors import InvalidValueError, ShapeError


class ForceSensorState(NamedTuple):
    """What the sensors of N robots remember; k forces, a delay of D ticks.

    To reset a robot, set its row of `started` to False.

    Attributes:
        filtered: (N, k) N, output of the filter.
        delayed: (N, D, k) N, filtered forces on their way, the oldest first.
        started: (N,) bool, whether the sensor has measured yet.
    """

    filtered: np.ndarray
    delayed: np.ndarray
    started: np.ndarray


@dataclass(frozen=True)
class ForceSensor:
    """A batch of equal force sensors, one per force component.

    White Gaussian noise is added, a first-order low-pass filter follows (exact for a force that is
    constant over a tick), and the result is reported some ticks late. The first measurement of a
    robot fills filter and delay, as if the force had been there for long. Through the filter noise
    keeps sqrt((1 - a) / (1 + a)) of its standard deviation, a = exp(-2 pi cutoff_hz / control_hz).

    Attributes:
        control_hz: control ticks per second; one measurement a tick.
        noise: N, standard deviation of a raw sample.
        cutoff_hz: Hz, of the continuous filter, 1 / (2 pi time constant); infinity for no filter.
        delay: ticks, at least 0.

    Raises:
        InvalidValueError: an attribute is out of range.
    """

    control_hz: float
    noise: float = 0.0
    cutoff_hz: float = math.inf
    delay: int = 0

    def __post_init__(self) -> None:
        """Validate."""
        for name, valid, expected in (
            ("control_hz", 0.0 < self.control_hz < math.inf, "a positive, finite number of Hz"),
            ("noise", 0.0 <= self.noise < math.inf, "a finite number of N, at least 0"),
            ("cutoff_hz", self.cutoff_hz > 0.0, "a positive number of Hz, or infinity"),
            (
                "delay",
                isinstance(self.delay, (int, np.integer)) and self.delay >= 0,
                "a whole number of ticks, at least 0",
            ),
        ):
            if not valid:
                raise InvalidValueError(name, getattr(self, name), expected)

    @property
    def memory(self) -> float:
        """Share of its last output in the filter's next one, a in [0, 1)."""
        return math.exp(-2.0 * math.pi * self.cutoff_hz / self.control_hz)

    def start(self, like: np.ndarray) -> ForceSensorState:
        """Return the state of sensors that have not measured yet, for forces like (N, k) `like`."""
        if like.ndim != 2:
            raise ShapeError("force", tuple(like.shape), "(N, k)")
        count, forces = like.shape
        return ForceSensorState(
            filtered=np.zeros((count, forces)),
            delayed=np.zeros((count, self.delay, forces)),
            started=np.zeros(count, bool),
        )

    def measure(
        self, force: np.ndarray, state: ForceSensorState, generator: np.random.Generator
    ) -> tuple[np.ndarray, ForceSensorState]:
        """Return what the sensors report at this tick.

        Args:
            force: (N, k) N, true.
            state: from `start` or the tick before; left as it is.
            generator: of the noise; not drawn from where there is none.

        Returns:
            The measured force (N, k) N and the state to pass to the next tick.

        Raises:
            ShapeError: the force does not fit the state.
        """
        check_shape("force", force, tuple(state.filtered.shape), "(N, k)")
        if self.noise > 0.0:
            force = force + generator.normal(0.0, self.noise, force.shape)
        started = state.started[:, None]
        held = self.memory * (state.filtered - force)
        filtered = np.where(started, force + held, force)
        delayed = np.where(started[..., None], state.delayed, filtered[:, None])
        queue = np.concatenate([delayed, filtered[:, None]], axis=1)
        following = ForceSensorState(filtered, queue[:, 1:], np.ones_like(state.started))
        return queue[:, 0], following
