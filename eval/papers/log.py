"""Log of a trial, and the numbers drawn from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

_SAME = 1e-6  # s, by which single precision may err


@dataclass(frozen=True, eq=False)
class Log:
    """T logged ticks of N robots; `log[name]` is a signal.

    Every trial has, before the tick's torque if not said otherwise:

        qpos: (T, N, ...) of the whole world, the robot's first.
        qvel: (T, N, nv) of the robot.
        torque: (T, N, n) N·m, of the tick, applied.
        contact_force: (T, N, P, 3) N, world, measured during the physics step before.
        push: (T, N, 3) N on the base, of the tick.

    and what its plan, its controller's command and its controller's memory add.
    """

    time: np.ndarray  # (T,) s
    fell: np.ndarray  # (N,) s at which each robot was lost; NaN for those still up
    signals: Mapping[str, np.ndarray]  # name -> (T, N, ...)

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a signal."""
        return self.signals[name]

    @property
    def error(self) -> np.ndarray:
        """(T, N, n) rad, joint angle minus target."""
        target = self["target"]
        return self["qpos"][:, :, 7 : 7 + target.shape[2]] - target

    @property
    def up(self) -> np.ndarray:
        """(T, N) bool, not yet fallen."""
        ended = np.where(np.isnan(self.fell), np.inf, self.fell)
        return self.time[:, None] < ended

    @property
    def survived(self) -> np.ndarray:
        """(N,) bool, up to the end."""
        return np.isnan(self.fell)

    def fall(self, index: int = 0) -> float | None:
        """Return when a robot fell, s, or None."""
        return None if self.survived[index] else float(self.fell[index])

    def rms(self, values: np.ndarray) -> np.ndarray:
        """Root mean square of (T, N, ...) over the ticks at which a robot was up.

        Returns:
            (N, ...), NaN for a robot that was up at no such tick.
        """
        kept = self.up.reshape(*self.up.shape, *(1,) * (values.ndim - 2))
        # where, not times: a diverged robot's values may be infinite.
        square = np.where(kept, np.asarray(values, float), 0.0) ** 2
        count = kept.sum(axis=0)
        mean = square.sum(axis=0) / np.maximum(count, 1)
        return np.sqrt(np.where(count > 0, mean, np.nan))

    def rms_of_joints(self, values: np.ndarray) -> np.ndarray:
        """Root mean square of (T, N, n) over these ticks and over the joints: (N,)."""
        return np.sqrt((self.rms(values) ** 2).mean(axis=1))

    def of(self, robots: slice | Sequence[int]) -> "Log":
        """Return the log of some of the robots."""
        signals = {name: value[:, robots] for name, value in self.signals.items()}
        return Log(self.time, self.fell[robots], signals)

    def groups(self, size: int) -> "list[Log]":
        """Return the logs of the first `size` robots, of the next, and so on."""
        return [self.of(slice(k, k + size)) for k in range(0, len(self.fell), size)]

    def at(self, moments: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return the rows of the first ticks from each of these s on, or of the last tick."""
        late = np.searchsorted(self.time, np.asarray(moments) - _SAME)
        return np.minimum(late, len(self.time) - 1)
