"""Random horizontal pushes on the base: drawn once per episode, evaluated for a whole batch."""

from dataclasses import dataclass

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.errors import InvalidValueError

_NEVER = np.iinfo(np.int64).max // 2


@dataclass(frozen=True)
class Pushes:
    """Pushes of constant force at random times, in random horizontal directions.

    Attributes:
        force: (least, most) N, drawn uniformly for each push. (0, 0) for none.
        duration: s.
        interval: (least, most) s from the start of one push (or of the episode) to the next.
    """

    force: tuple[float, float]
    duration: float
    interval: tuple[float, float]

    def __post_init__(self) -> None:
        """Reject what cannot be scheduled."""
        for name, pair in (("push_force", self.force), ("push_interval", self.interval)):
            if len(pair) != 2 or not 0 <= pair[0] <= pair[1] < np.inf:
                raise InvalidValueError(name, pair, "a pair 0 <= least <= most, finite")
        if not 0 < self.duration < np.inf:
            raise InvalidValueError("push_duration", self.duration, "a positive time in s")
        if self.interval[0] < self.duration:
            raise InvalidValueError(
                "push_interval", self.interval, f"at least push_duration = {self.duration} s"
            )

    def draw(
        self, rng: np.random.Generator, seconds: float, hz: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Draw the pushes of one episode of `seconds` with `hz` control ticks per second.

        Returns:
            start: (K,) control tick at which each push begins; far beyond the episode if unused.
            force: (K, 3) N, world.
        """
        count = int(np.ceil(seconds / self.interval[0]))
        times = np.cumsum(rng.uniform(*self.interval, size=count))
        size, angle = rng.uniform(*self.force, size=count), rng.uniform(-np.pi, np.pi, size=count)
        force = np.stack([size * np.cos(angle), size * np.sin(angle), 0.0 * angle], axis=1)
        start = np.where(times < seconds, np.round(times * hz).astype(np.int64), _NEVER)
        return start, force

    def at(self, start: np.ndarray, force: np.ndarray, tick: np.ndarray, hz: int) -> np.ndarray:
        """Return the force on each base.

        Args:
            start: (N, K) as drawn.
            force: (N, K, 3) N as drawn.
            tick: (..., N) control ticks since the episode began.
            hz: control ticks per second.

        Returns:
            (..., N, 3) N, world.
        """
        rows = np.ascontiguousarray(tick).reshape(-1, len(start))
        applied = _applied(start, force, rows, round(self.duration * hz))
        return applied.reshape(*tick.shape, 3)


@kernel
def _applied(start: np.ndarray, force: np.ndarray, tick: np.ndarray, duration: int) -> np.ndarray:
    """Return the forces (T, N, 3) at ticks (T, N), see `Pushes.at`."""
    applied = np.zeros((len(tick), len(start), 3))
    for row in range(len(tick)):
        for i in range(len(start)):
            for k in range(start.shape[1]):
                if 0 <= tick[row, i] - start[i, k] < duration:
                    for axis in range(3):
                        applied[row, i, axis] += force[i, k, axis]
    return applied
