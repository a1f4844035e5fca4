"""Observation of a policy, and of its critic: one row of numbers, with a name for each.

"full" is the task's table, at the state as controllers know it. "body" is the part of it that means
the same on every legged robot, see `fbid_gym.tasks.body_view`. "measured" is for robots: it begins
with the group "policy", of what the robot is told, does itself or reads from its sensors, the last
`history` steps of it, newest first; "measured+estimate" adds the rest of the table by the estimate.
Then comes the group "critic", for training alone: the table at the true state, and how plant and
sensors were drawn.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fbid_gym.estimation.estimator import Estimator
from fbid_gym.runtime import answers
from fbid_gym.tasks import Task
from fbid_gym.tasks.body_view import body_view
from fbid_gym.tasks.observation import (
    ESTIMATED,
    KNOWN,
    MEASURED,
    Group,
    Groups,
    columns,
    entry_bounds,
    entry_names,
    entry_units,
)

FULL, BODY = "full", "body"
OBSERVATIONS = (FULL, BODY, "measured", "measured+estimate")
"""Kinds of observation."""

POLICY, CRITIC = "policy", "critic"
"""Groups of an observation for robots."""


class Observer:
    """The observation of N robots.

    Attributes:
        groups: the task's table.
        seen: what a policy sees of that and of the sensors, without history.
        names: of all entries.
        bound: (O,) largest size of each entry; observations are clipped to it.
        columns: name of a group -> where in an observation it is.
        arrays: what goes on from step to step; live.
    """

    def __init__(
        self,
        task: Task,
        kind: str,
        history: int,
        count: int,
        estimator: Estimator | None = None,
        drawn: Mapping[str, Mapping[str, np.ndarray]] | None = None,
    ) -> None:
        """Lay out the observation of so many robots.

        Args:
            task: the task.
            kind: one of `OBSERVATIONS`.
            history: policy steps that are observed together.
            count: of robots.
            estimator: has what they read; None where sensors are perfect.
            drawn: how their "plant" and "sensor" were drawn for an episode: (N, ...) by name; live.
                None: nobody knows that, nor the true state, and there is no critic.
        """
        self.groups, self._task, self._count = answers.checked_groups(task), task, count
        measured = kind not in (FULL, BODY)
        self._split = measured and drawn is not None
        self.arrays: dict[str, np.ndarray] = {}
        table = body_view(self.groups, task.body) if kind == BODY else self.groups
        seen, chance = dict(table), _drawn(drawn or {})
        told = {**{f"actual_{n}": group for n, group in self.groups.items()}, **chance}
        if measured and estimator is not None:
            sources = (KNOWN, MEASURED, ESTIMATED) if "estimate" in kind else (KNOWN, MEASURED)
            seen = {n: g for n, g in self.groups.items() if g.source in sources}
            seen |= _sensed(estimator)
        self.seen, self._told = seen, told
        self._parts = answers.Parts.of_observation(seen, count)
        own = entry_names(seen)
        ages = range(1, history)
        self.names = (*own, *(f"{name}, {age} steps ago" for age in ages for name in own))
        self.columns = columns(seen)
        bound = np.tile(entry_bounds(seen), history)
        if measured or history > 1:
            self.columns[POLICY] = slice(0, len(bound))
            self.arrays["recent"] = np.zeros((count, history, len(own)), np.float32)
        if self._split:
            self._told_parts = answers.Parts.of_observation(told, count)
            first = len(self.names)
            self.names += tuple(f"actual {name}" for name in entry_names(self.groups))
            self.names += entry_names(chance)
            self.columns |= {
                name: slice(first + part.start, first + part.stop)
                for name, part in columns(told).items()
            }
            self.columns[CRITIC] = slice(first, len(self.names))
            bound = np.concatenate([bound, entry_bounds(told)])
        self.bound = bound
        # As large as what is clipped to them: NumPy is faster so.
        self._most = np.tile(bound, (count, 1))
        self._least, units = -self._most, entry_units(seen)
        self._units = units if (units != 1.0).any() else None

    def observe(self, known: Any, actual: Any, ids: np.ndarray | None = None) -> np.ndarray:
        """Return observations (N, O) float32, clipped.

        Args:
            known: what the task measures at the state as controllers know it.
            actual: what it measures at the true one.
            ids: (K,) robots that have just begun, whose past is as their present; else a step has
                passed for all.
        """
        parts = [group.function(known) for group in self.seen.values()]
        joined = self._parts.joined(parts, self._task)
        if self._units is not None:
            joined /= self._units
        seen = self._clipped(joined, 0)
        if "recent" in self.arrays:
            recent = self.arrays["recent"]
            if ids is None:
                recent[:, 1:] = recent[:, :-1].copy()
                recent[:, 0] = seen
            else:
                recent[ids] = seen[ids, None]
            seen = recent.reshape(self._count, -1).copy()
        if not self._split:
            return seen
        parts = [group.function(actual) for group in self._told.values()]
        told = self._clipped(self._told_parts.joined(parts, self._task), seen.shape[1])
        return np.concatenate([seen, told], axis=1)

    def _clipped(self, values: np.ndarray, first: int) -> np.ndarray:
        part = slice(first, first + values.shape[1])
        np.maximum(values, self._least[:, part], out=values)
        np.minimum(values, self._most[:, part], out=values)
        return values.astype(np.float32)


def _sensed(estimator: Estimator) -> Groups:
    """Read the sensors in trunk and feet, with what has arrived."""
    readings, feet = estimator.readings, estimator.foot_names
    return {
        "gyroscope": Group.of(
            "gyroscope {} (rad/s)", "xyz", 100.0, lambda m: readings.gyroscope, MEASURED
        ),
        "accelerometer": Group.of(
            "accelerometer {} (m/s^2)", "xyz", 1000.0, lambda m: readings.accelerometer, MEASURED
        ),
        "contact": Group.of(
            "{} told to be on the ground (1)", feet, 1.0, lambda m: estimator.contact, MEASURED
        ),
    }


def _drawn(parts: Mapping[str, Mapping[str, np.ndarray]]) -> Groups:
    """How plant and sensors of this episode were drawn, and who errs by how much now."""

    def shown(values: np.ndarray) -> Callable[[Any], np.ndarray]:
        return lambda m: values.reshape(len(values), -1)

    found: dict[str, Group] = {}
    for part, arrays in parts.items():
        for name, values in arrays.items():
            size = values[0].size
            words = [f" {k}" for k in range(size)] if size > 1 else [""]
            called = f"{part} {name.replace('_', ' ')}{{}}"
            found[f"{part}_{name}"] = Group.of(called, words, 100.0, shown(values), KNOWN)
    return found
