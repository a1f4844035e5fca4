"""Check the answers of tasks and layers, which users write, too.

Compiled code that follows trusts the shapes of what it is given.
"""

from collections.abc import Iterable, Mapping
from math import isfinite
from typing import Any, NamedTuple, NoReturn

import numpy as np

from fbid_gym.actions import ActionLayer
from fbid_gym.errors import InvalidValueError, NonFiniteError, ShapeError
from fbid_gym.options import Number
from fbid_gym.tasks import Group, Plan, Task
from fbid_gym.tasks.observation import Groups

_POSITIVE = Number(1e-9, 1e9)
_FLOAT = np.dtype(float)
_MOST_PLANNED = 2**30  # bytes, of all robots' episodes
DRAWN = ("qpos", "qvel", "push_start", "push_force", "push_velocity")
"""Entries of every plan: drawn by chance, and of simulations."""


def check_plan(task: Task, drawn: Plan) -> None:
    """Raise an FbidError unless what a task draws is what `Task` says."""
    kind = type(task).__name__
    if not isinstance(drawn, Mapping) or not drawn.keys() >= set(DRAWN):
        _refuse(drawn, kind, f"a dictionary that holds at least {', '.join(DRAWN)}")
    for name, value in drawn.items():
        if not isinstance(value, np.ndarray | np.generic):
            raise InvalidValueError(f"{name!r} drawn by {kind}", value, "an array")
    robot = task.body.robot
    for name, size in (("qpos", robot.nq), ("qvel", robot.nv)):
        if drawn[name].shape != (size,):
            raise ShapeError(f"{name!r} drawn by {kind}", drawn[name].shape, f"({size},)")


def checked_groups(task: Task) -> Groups:
    """Return the groups of a task's observation, or raise an FbidError."""
    called, groups = f"observation_groups of {type(task).__name__}", task.observation_groups
    known = isinstance(groups, Mapping)
    if not known or not all(isinstance(group, Group) for group in groups.values()):
        raise InvalidValueError(called, groups, "a dictionary from names to Groups")
    for name, group in groups.items():
        _POSITIVE.check(f"bound of {name!r} in {called}", group.bound)
    return groups


def check_size(drawn: Plan, num_envs: int, seconds: float) -> None:
    """Raise InvalidValueError where what is drawn for the episodes takes more than it may."""
    total = num_envs * sum(value.nbytes for value in drawn.values())
    if total > _MOST_PLANNED:
        expected = (
            f"less: the pushes and commands of {num_envs:,} such episodes take "
            f"{total / 2**30:.3g} GiB, more than {_MOST_PLANNED / 2**30:g}"
        )
        raise InvalidValueError("episode_seconds", seconds, expected)


def check_drawn(task: Task, drawn: Plan, plan: Plan) -> None:
    """Raise an FbidError unless another episode is drawn of the arrays that make up the plan."""
    kind = type(task).__name__
    if not isinstance(drawn, Mapping) or drawn.keys() != plan.keys():
        _refuse(drawn, kind, f"what it drew before: {', '.join(plan)}")
    for name, value in drawn.items():
        if np.shape(value) != plan[name].shape[1:]:
            expected = f"{plan[name].shape[1:]}, as it had before"
            raise ShapeError(f"{name!r} drawn by {kind}", np.shape(value), expected)


def _refuse(drawn: Any, kind: str, expected: str) -> NoReturn:
    found = sorted(drawn) if isinstance(drawn, Mapping) else drawn
    raise InvalidValueError(f"plan drawn by {kind}", found, expected)


def check_memory(memory: Any, num_robots: int, whose: object) -> None:
    """Raise an FbidError unless a memory has a row for each of the robots in all of its arrays."""
    kind = type(whose).__name__
    if not isinstance(memory, Mapping):
        raise InvalidValueError(f"memory of {kind}", memory, "a dictionary of arrays by name")
    for name, value in memory.items():
        if not isinstance(value, np.ndarray):
            raise InvalidValueError(f"{name!r} in the memory of {kind}", value, "an array")
        if value.shape[:1] != (num_robots,):
            expected = f"({num_robots}, ...), a row for each robot"
            raise ShapeError(f"{name!r} in the memory of {kind}", value.shape, expected)


def check_layer(layer: ActionLayer, memory: Any, num_robots: int) -> None:
    """Raise an FbidError unless a layer's names and its memory are what `ActionLayer` says."""
    kind = type(layer).__name__
    check_memory(memory, num_robots, layer)
    for called in ("action_names", "diagnostics"):
        names = getattr(layer, called, None)
        if not isinstance(names, tuple | list) or not all(isinstance(name, str) for name in names):
            raise InvalidValueError(f"{called} of {kind}", names, "a tuple of names")
    unknown = [name for name in layer.diagnostics if name not in memory]
    if unknown:
        expected = f"names in its memory: {', '.join(memory) or 'none'}"
        raise InvalidValueError(f"diagnostics of {kind}", unknown[0], expected)


def as_numbers(answer: Any, shape: tuple[int, ...], whose: object, name: str) -> np.ndarray:
    """Return the answer of a task or a layer, by its name, as a C-contiguous array of float64.

    Raises:
        ShapeError: another shape.
        InvalidValueError: no numbers.
    """
    if type(answer) is np.ndarray and answer.dtype == _FLOAT and answer.flags.c_contiguous:
        found = answer
    else:
        try:
            found = np.ascontiguousarray(answer, dtype=float)
        except (TypeError, ValueError):
            called = f"{name} of {type(whose).__name__}"
            raise InvalidValueError(called, answer, f"numbers of shape {shape}") from None
    if found.shape != shape:
        raise ShapeError(f"{name} of {type(whose).__name__}", np.shape(answer), f"{shape}")
    return found


class Parts(NamedTuple):
    """Expected parts of a task's answer, which follow each other along the last axis."""

    names: tuple[str, ...]  # of the parts
    shapes: tuple[tuple[int, ...], ...]  # of the parts
    whole: tuple[int, ...]  # shape of all of them together

    @classmethod
    def of_observation(cls, groups: Groups, count: int) -> "Parts":
        """Return those of an observation of so many robots."""
        sizes = [len(group.names) for group in groups.values()]
        names = tuple(f"observation group {name!r}" for name in groups)
        return cls(names, tuple((count, size) for size in sizes), (count, sum(sizes)))

    @classmethod
    def of_rows(cls, kind: str, names: Iterable[str], count: int) -> "Parts":
        """Return those of numbers (count,) by name, a row for each."""
        called = tuple(f"{kind} {name!r}" for name in names)
        return cls(called, ((count,),) * len(called), (len(called) * count,))

    def joined(self, answers: list[Any], task: Task) -> np.ndarray:
        """Return the parts in one array of float64, or raise an FbidError, see `as_numbers`."""
        # At every step, and mostly right. Where something is wrong, whose it is is looked for.
        try:
            found = np.concatenate(answers, axis=-1, dtype=float)
        except (TypeError, ValueError):
            found = np.empty(0)
        if found.shape == self.whole:
            return found
        known = zip(answers, self.shapes, self.names, strict=True)
        each = [as_numbers(answer, shape, task, name) for answer, shape, name in known]
        return np.concatenate([*each, np.empty((*self.whole[:-1], 0))], axis=-1)


def metric_names(metrics: Any, task: Task) -> tuple[str, ...]:
    """Return the names of a task's metrics, or raise an FbidError."""
    if not isinstance(metrics, Mapping):
        called = f"metrics of {type(task).__name__}"
        raise InvalidValueError(called, metrics, "a dictionary of arrays by name")
    return tuple(metrics)


def summed(shares: np.ndarray, names: Iterable[str], task: Task) -> np.ndarray:
    """Return the rewards (N,) that terms (T, N) make together.

    Raises:
        NonFiniteError: a term that is not finite, of robots whose state is.
    """
    total: np.ndarray = np.add.reduce(shares)
    if not isfinite(total.dot(total)):  # as is any of them, or one whose square is too large
        for name, row in zip(names, shares, strict=True):
            for robot in np.flatnonzero(~np.isfinite(row)):
                raise NonFiniteError(
                    f"reward term {name!r} of {type(task).__name__}", (int(robot),)
                )
    return total
