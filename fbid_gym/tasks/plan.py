"""All that chance decides about an episode."""

import numpy as np

from fbid_gym.errors import InvalidValueError

MOST_EVENTS = 100_000
"""Pushes, or commands, in one episode; all of them are drawn as it begins."""

Plan = dict[str, np.ndarray]
"""All that chance decided about the episodes of N robots, one row each: see `Task.draw`."""


def check_schedule(name: str, interval: tuple[float, float], seconds: float) -> None:
    """Raise InvalidValueError where an episode of `seconds` has more events than are drawn.

    Args:
        name: of the interval.
        interval: (least, most) s from one event to the next.
        seconds: length of an episode.
    """
    least = seconds / MOST_EVENTS
    if interval[0] < least:
        raise InvalidValueError(
            name,
            interval,
            f"at least {least:g} s at episode_seconds = {seconds:g}: an episode has room for "
            f"{MOST_EVENTS:,} of them",
        )
