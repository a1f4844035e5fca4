"""Which level of its terrain each robot walks on: up after success, down after a fall.

## Arguments
With `curriculum=True` robots move through eleven levels, difficulty 0 to 1, and begin at that
nearest to `difficulty`. One that gets to the end of its episode or of its ground with a mean error
of velocity of at most 0.12 sqrt(g h) starts its next episode a level higher; one that falls, a
level lower. `reset(seed=...)` takes it back to the first; `state_dict` keeps it. `info` has
`terrain_level`, 0 to 10, of the present episode.
"""

from dataclasses import dataclass

import numpy as np

from fbid_gym.robots.terrain import Tiles


@dataclass(frozen=True, eq=False)
class Climb:
    """Of N robots."""

    tiles: Tiles  # of the terrain
    first: int  # level at which they begin
    # All that changes, by name: "level" (N,) int64, of the next or present episode; "error" (N,)
    # m/s, sum of the errors of velocity; "steps" (N,) int64, how many these are; "ended" (N,) bool,
    # whether the episode has.
    arrays: dict[str, np.ndarray]

    @classmethod
    def of(cls, num_robots: int, tiles: Tiles, difficulty: float) -> "Climb":
        """Return robots at the level of a difficulty, from 0 to 1."""
        first = round(difficulty * (tiles.number - 1))
        return cls(
            tiles,
            first,
            {
                "level": np.full(num_robots, first, np.int64),
                "error": np.zeros(num_robots),
                "steps": np.zeros(num_robots, np.int64),
                "ended": np.ones(num_robots, bool),
            },
        )

    @property
    def level(self) -> np.ndarray:
        """(N,) int64."""
        return self.arrays["level"]

    def begin(self, robot: int) -> None:
        """Take a robot back to the first level."""
        self.arrays["level"][robot] = self.first

    def starts(self, places: np.ndarray, robot: int) -> np.ndarray:
        """Return those of the places (K, 2) that lie on a robot's tile."""
        return places.reshape(self.tiles.number, -1, 2)[self.level[robot]]

    def set_out(self, ids: np.ndarray) -> None:
        """Begin episodes of robots (K,)."""
        self.arrays["error"][ids], self.arrays["steps"][ids] = 0.0, 0
        self.arrays["ended"][ids] = False

    def advance(
        self, error: np.ndarray, tolerance: float, fell: np.ndarray, lasted: np.ndarray
    ) -> None:
        """Count a step; an episode that ends with it decides on the level of the next.

        Args:
            error: (N,) m/s, of the velocity.
            tolerance: m/s, mean error up to which a robot follows its commands.
            fell: (N,) bool, whose episode ends so.
            lasted: (N,) bool, whose episode ends otherwise.
        """
        level, total, steps, ended = self.arrays.values()
        total += error
        steps += 1
        # A robot whose episode has ended may be stepped on, before it is reset.
        up = lasted & ~ended & (total <= tolerance * steps)
        down = fell & ~ended
        level[:] = np.clip(level + up - down, 0, self.tiles.number - 1)
        ended |= fell | lasted
