"""The observation: a table of groups, each a function of the task's measurements."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

KNOWN, MEASURED, ESTIMATED, FORCES = "known", "measured", "estimated", "forces"
"""How a robot comes by a part of its observation: it is told or its own doing, as commands, clocks
and torques are; joints measure it; it has to be estimated; or forces at the feet, which few can."""


class Group(NamedTuple):
    """A part of the observation.

    Attributes:
        names: one per entry, with its unit in brackets.
        bound: largest size of an entry; what is larger is clipped.
        function: takes what the task measured of N robots, see `Task.measure`, and returns
            (N, number of names). It changes nothing.
        source: how a robot comes by it: `KNOWN`, `MEASURED`, `ESTIMATED` or `FORCES`.
        unit: what the numbers of the function are divided by; one, or one per entry.
    """

    names: tuple[str, ...]
    bound: float
    function: Callable[[Any], np.ndarray]
    source: str = ESTIMATED
    unit: float | np.ndarray = 1.0

    @classmethod
    def of(
        cls,
        name: str,
        words: Iterable[str],
        bound: float,
        function: Callable[[Any], np.ndarray],
        source: str = ESTIMATED,
    ) -> "Group":
        """Return a group with an entry for each word, which stands where {} does in the name."""
        return cls(tuple(name.format(word) for word in words), bound, function, source)


Groups = Mapping[str, Group]
"""The table of an observation: name -> group, in the order of the entries."""


def entry_names(groups: Groups) -> tuple[str, ...]:
    """Return the name of each entry of an observation."""
    return tuple(name for group in groups.values() for name in group.names)


def entry_bounds(groups: Groups) -> np.ndarray:
    """Return the largest size of each entry of an observation: (O,)."""
    return np.repeat(
        [float(group.bound) for group in groups.values()],
        [len(group.names) for group in groups.values()],
    )


def entry_units(groups: Groups) -> np.ndarray:
    """Return what each entry of an observation is divided by: (O,)."""
    each = [np.broadcast_to(group.unit, len(group.names)) for group in groups.values()]
    return np.concatenate([*each, np.empty(0)])


def columns(groups: Groups) -> dict[str, slice]:
    """Return where in an observation each group is."""
    ends = np.cumsum([len(group.names) for group in groups.values()]).tolist()
    return {
        name: slice(end - len(group.names), end)
        for (name, group), end in zip(groups.items(), ends, strict=True)
    }
