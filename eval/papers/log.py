"""What a trial leaves behind, and the numbers drawn from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fbid_gym.bundles import write_file
from fbid_gym.envs.simulation import Simulation
from fbid_gym.errors import RunError
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot

if TYPE_CHECKING:
    from eval.papers.trial import Command

_PER_TICK = (
    "qpos",
    "qvel",
    "target",
    "feedforward",
    "feedback",
    "contact_force",
    "push",
    "planted",
)


@dataclass(frozen=True, eq=False)
class Log:
    """T logged ticks of N robots; P contact points, F feet.

    Attributes:
        time: (T,) s.
        qpos: (T, N, nq) before the tick's torque.
        qvel: (T, N, nv).
        target: (T, N, n) rad, joints of the reference.
        feedforward: (T, N, n) N·m, commanded.
        feedback: (T, N, n) N·m, commanded.
        contact_force: (T, N, P, 3) N, world, measured during the physics step before.
        push: (T, N, 3) N.
        planted: (T, N, F) bool, feet that the reference plants.
        limit: (n,) N·m; applied was feedforward + feedback clipped to it.
        fell: (N,) s at which each robot was lost; NaN for those still up.
        watched: name -> (T, N, ...) entries of the controller's memory, after the tick.
    """

    time: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    target: np.ndarray
    feedforward: np.ndarray
    feedback: np.ndarray
    contact_force: np.ndarray
    push: np.ndarray
    planted: np.ndarray
    limit: np.ndarray
    fell: np.ndarray
    watched: dict[str, np.ndarray]

    @property
    def torque(self) -> np.ndarray:
        """(T, N, n) N·m commanded and within the limits."""
        return np.clip(self.feedforward + self.feedback, -self.limit, self.limit)

    @property
    def error(self) -> np.ndarray:
        """(T, N, n) rad, joint angle minus target."""
        return self.qpos[:, :, 7:] - self.target

    @property
    def up(self) -> np.ndarray:
        """(T, N) bool, not yet fallen."""
        ended = np.where(np.isnan(self.fell), np.inf, self.fell)
        return self.time[:, None] < ended

    @property
    def survived(self) -> np.ndarray:
        """(N,) bool, up to the end."""
        return np.isnan(self.fell)

    def rms(self, values: np.ndarray, since: float = 0.0, until: float = np.inf) -> np.ndarray:
        """Root mean square over the ticks at which a robot was up.

        Args:
            values: (T, N, ...).
            since: s, leave out what came before.
            until: s, leave out what comes then and after.

        Returns:
            (N, ...), NaN for a robot that was up at no such tick.
        """
        inside = (self.time >= since) & (self.time < until)
        kept = self.up & inside[:, None]
        weight = kept.reshape(*kept.shape, *(1,) * (values.ndim - 2)).astype(float)
        # where, not times: a diverged robot's values may be infinite.
        square = np.where(weight > 0, np.asarray(values, float), 0.0) ** 2
        count = weight.sum(axis=0)
        mean = square.sum(axis=0) / np.maximum(count, 1.0)
        return np.sqrt(np.where(count > 0, mean, np.nan))

    def of(self, robots: slice | Sequence[int]) -> "Log":
        """Return the log of some of the robots."""
        return Log(
            time=self.time,
            **{name: getattr(self, name)[:, robots] for name in _PER_TICK},
            limit=self.limit,
            fell=self.fell[robots],
            watched={name: value[:, robots] for name, value in self.watched.items()},
        )

    def arrays(self, prefix: str = "") -> dict[str, np.ndarray]:
        """Return all arrays by name, single precision, for `numpy.savez`."""
        named = {name: getattr(self, name) for name in ("time", *_PER_TICK, "limit", "fell")}
        named |= {f"watched.{name}": value for name, value in self.watched.items()}
        return {f"{prefix}{name}": _single(value) for name, value in named.items()}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], prefix: str = "") -> "Log":
        """Rebuild a log from `arrays` of the same prefix."""
        own = {k.removeprefix(prefix): v for k, v in arrays.items() if k.startswith(prefix)}
        watched = {k.removeprefix("watched."): v for k, v in own.items() if "watched." in k}
        return cls(watched=watched, **{k: v for k, v in own.items() if "watched." not in k})


def _single(value: np.ndarray) -> np.ndarray:
    return value.astype(np.float32) if value.dtype == np.float64 else value


class Recorder:
    """Collects the ticks of a trial."""

    def __init__(self, robot: Robot, num_robots: int, tick_seconds: float) -> None:
        """Start empty."""
        self._limit, self._feet = robot.torque_limit, robot.num_feet
        self._tick_seconds = tick_seconds
        self._rows: dict[str, list[np.ndarray]] = {name: [] for name in _PER_TICK}
        self._watched: dict[str, list[np.ndarray]] = {}
        self.fell = np.full(num_robots, np.nan)

    def lose(self, robots: np.ndarray, step: int) -> None:
        """Note that the `robots` (N,) bool were lost at a control tick."""
        self.fell[robots] = step * self._tick_seconds

    def add(
        self,
        simulation: Simulation,
        reference: Reference,
        command: "Command",
        push: np.ndarray,
        watched: Mapping[str, np.ndarray],
    ) -> None:
        """Keep one tick."""
        planted = reference.planted
        if planted is None:
            planted = np.ones((simulation.num_robots, self._feet), bool)
        values = (
            simulation.qpos,
            simulation.qvel,
            reference.qpos[:, 7:],
            command.feedforward,
            command.feedback,
            simulation.contact_force,
            push,
            planted,
        )
        for name, value in zip(_PER_TICK, values, strict=True):
            self._rows[name].append(_single(np.array(value)))
        for name, value in watched.items():
            self._watched.setdefault(name, []).append(_single(np.array(value)))

    def log(self, every: int) -> Log:
        """Return what was collected, a row for each `every`-th tick."""
        stacked = {name: np.array(rows) for name, rows in self._rows.items()}
        return Log(
            time=np.arange(len(stacked["qpos"])) * every * self._tick_seconds,
            **stacked,
            limit=np.array(self._limit),
            fell=self.fell,
            watched={name: np.array(rows) for name, rows in self._watched.items()},
        )


def save_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays to a compressed .npz file, whole or not at all."""
    import io

    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]  # names are never "file"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, buffer.getvalue())


def load_arrays(path: Path) -> dict[str, np.ndarray]:
    """Read the arrays of a .npz file.

    Raises:
        RunError: there is no such file.
    """
    if not path.is_file():
        raise RunError(f"{path} is not there. Run the experiment first.")
    with np.load(path, allow_pickle=False) as file:
        return dict(file)
