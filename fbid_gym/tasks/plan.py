"""The plan: all random parts of an episode."""

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.errors import InvalidValueError

MOST_EVENTS = 100_000
"""Pushes, or commands, in one episode; all of them are drawn as it begins."""

Plan = dict[str, np.ndarray]
"""All that chance decided about the episodes of N robots, one row each: see `Task.draw`."""


def drawn_commands(
    rng: np.random.Generator, interval: tuple[float, float], seconds: float, hz: int
) -> tuple[int, Plan]:
    """Draw when the commands of an episode begin.

    Args:
        rng: of the episode.
        interval: (least, most) s from one command to the next.
        seconds: length of the episode.
        hz: control ticks per second.

    Returns:
        K, how many commands there are, and "command_start": (K,) control ticks, the first at 0.
    """
    count = int(np.ceil(seconds / interval[0])) + 1
    times = np.cumsum(rng.uniform(*interval, size=count))
    return count, {"command_start": np.concatenate([[0.0], times[:-1]]) * hz}


@kernel
def command_at(
    start: np.ndarray, ramp: np.ndarray, command: np.ndarray, tick: np.ndarray
) -> np.ndarray:
    """Return the commands of N robots.

    Args:
        start: (N, K) control ticks at which commands begin.
        ramp: (N, K) control ticks that each takes to come evenly from the one before; 0: none.
        command: (N, K, C).
        tick: (N,) control ticks since the episode began.

    Returns:
        (N, C).
    """
    axes = command.shape[2]
    found = np.empty((len(tick), axes))
    for i in range(len(tick)):
        index = last_started(start[i], tick[i])
        left = 1.0 - (tick[i] - start[i, index]) / max(ramp[i, index], 1.0)
        for axis in range(axes):
            found[i, axis] = command[i, index, axis]
            if left > 0.0 and ramp[i, index] > 0.0:
                before = command[i, max(index - 1, 0), axis]
                found[i, axis] += left * (before - found[i, axis])
    return found


@compiled
def last_started(start: np.ndarray, tick: int) -> int:
    """Return which of those that start at ticks (K,), in order, is the last to have started."""
    index = -1
    for k in range(len(start)):
        index += start[k] <= tick
    return index


def check_schedule(name: str, interval: tuple[float, float], seconds: float) -> None:
    """Raise InvalidValueError where an episode of `seconds` has more events than are drawn.

    The interval is (least, most) s from one event to the next.
    """
    least = seconds / MOST_EVENTS
    if interval[0] < least:
        expected = f"at least {least:g} s at episode_seconds = {seconds:g}: an episode has room for"
        raise InvalidValueError(name, interval, f"{expected} {MOST_EVENTS:,} of them")
