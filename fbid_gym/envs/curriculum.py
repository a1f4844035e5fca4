"""Levels of terrain and commands, robot by robot: up after success, else down.

## Arguments
With `curriculum=True` robots move through eleven levels, difficulty 0 to 1, and begin at that
nearest to `difficulty`. One that gets to the end of its episode or of its ground with a mean error
of velocity of at most 0.12 sqrt(g h) starts its next episode a level higher; one that falls, a
level lower. With `command_curriculum=True` the same levels are those of the commands, on any
ground: at level k of 10 they are k tenths of what is drawn from their ranges. `reset(seed=...)`
takes a robot back to the first level; `state_dict` keeps it. `info` has `terrain_level` and
`command_level`, 0 to 10, of the present episode.
"""

import numpy as np

from fbid_gym.robots.terrain import NUM_LEVELS, Tiles
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.tasks import Plan


class Climb:
    """Levels of N robots."""

    def __init__(self, num_robots: int, tiles: Tiles, config: EnvConfig) -> None:
        """Begin at the level of the difficulty of the environment, whose terrain has `tiles`."""
        self._tiles = tiles
        asked = {"terrain": config.curriculum, "command": config.command_curriculum}
        self.names = [name for name, given in asked.items() if given]  # of what has levels
        self.levels = NUM_LEVELS if config.command_curriculum else tiles.number
        self._first = round(config.difficulty * (self.levels - 1))  # where they begin
        # All that changes, by name: level of the next or present episode; sum of its errors of
        # velocity, m/s, and how many these are; whether it has ended.
        self.arrays = {
            "level": np.full(num_robots, self._first, np.int64),
            "error": np.zeros(num_robots),
            "steps": np.zeros(num_robots, np.int64),
            "ended": np.ones(num_robots, bool),
        }

    @property
    def level(self) -> np.ndarray:
        """(N,) int64."""
        return self.arrays["level"]

    def begin(self, robot: int) -> None:
        """Take a robot back to the first level."""
        self.arrays["level"][robot] = self._first

    def place(self, starts: np.ndarray, robot: int, rng: np.random.Generator) -> np.ndarray:
        """Draw from the places (K, 2) m that of a robot, on its tile: (2,) m."""
        tile = min(self.level[robot], self._tiles.number - 1)
        places = starts.reshape(self._tiles.number, -1, 2)[tile]
        # Level ground is the same everywhere.
        return places[0] if len(places) == 1 else places[rng.integers(len(places))]

    def tame(self, plan: Plan, robot: int) -> None:
        """Make the commands that were drawn for a robot those of its level, if they have some."""
        if "command" in self.names:
            plan["command"][robot] *= self.level[robot] / (self.levels - 1)

    def set_out(self, ids: np.ndarray) -> None:
        """Begin episodes of robots (K,)."""
        self.arrays["error"][ids], self.arrays["steps"][ids] = 0.0, 0
        self.arrays["ended"][ids] = False

    def advance(
        self, error: np.ndarray, tolerance: float, fell: np.ndarray, lasted: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Count a step; an episode that ends with it decides on the level of the next.

        A robot follows its commands if the mean `error` (N,) of its velocity, m/s, is at most the
        tolerance. `fell` and `lasted` (N,) bool say whose episode ends, by a fall or otherwise.
        Returns the levels (N,) of this step, for the info.
        """
        told = {f"{name}_level": self.level.copy() for name in self.names}
        level, total, steps, ended = self.arrays.values()
        total += error
        steps += 1
        # A robot whose episode has ended may be stepped on, before it is reset.
        up = lasted & ~ended & (total <= tolerance * steps)
        down = fell & ~ended
        level[:] = np.clip(level + up - down, 0, self.levels - 1)
        ended |= fell | lasted
        return told
