"""What tasks and layers answer is what they promise: users write them, too.

Compiled code that follows trusts the shapes of what it is given.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fbid_gym.errors import InvalidValueError, ShapeError
from fbid_gym.tasks import Plan, Task

_FLOAT = np.dtype(float)
_PLANNED = ("qpos", "qvel", "push_start", "push_force", "push_velocity")


def check_plan(task: Task, drawn: Plan) -> None:
    """Raise an FbidError unless what a task draws, and sees, is what `Task` says."""
    kind = type(task).__name__
    if not isinstance(drawn, Mapping) or not drawn.keys() >= set(_PLANNED):
        found = sorted(drawn) if isinstance(drawn, Mapping) else drawn
        expected = f"a dictionary that holds at least {', '.join(_PLANNED)}"
        raise InvalidValueError(f"plan drawn by {kind}", found, expected)
    for name, value in drawn.items():
        if not isinstance(value, np.ndarray | np.generic):
            raise InvalidValueError(f"{name!r} drawn by {kind}", value, "an array")
    robot = task.body.robot
    for name, size in (("qpos", robot.nq), ("qvel", robot.nv)):
        if drawn[name].shape != (size,):
            raise ShapeError(f"{name!r} drawn by {kind}", drawn[name].shape, f"({size},)")
    names, bound = task.observation_names, task.observation_bound
    if np.shape(bound) != (len(names),):
        expected = f"({len(names)},), a bound for each of observation_names"
        raise ShapeError(f"observation_bound of {kind}", np.shape(bound), expected)


def as_numbers(answer: Any, shape: tuple[int, ...], whose: object, name: str) -> np.ndarray:
    """Return an answer as a C-contiguous array of float64.

    Args:
        answer: of a task or a layer.
        shape: that it shall have.
        whose: answer it is.
        name: of the answer.

    Raises:
        ShapeError: another shape.
        InvalidValueError: no numbers.
    """
    if type(answer) is np.ndarray and answer.dtype is _FLOAT and answer.flags.c_contiguous:
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


def as_terms(answer: Any, count: int, task: Task, name: str) -> dict[str, np.ndarray]:
    """Return named rows of numbers, each (count,), see `as_numbers`."""
    if not isinstance(answer, Mapping):
        called = f"{name} of {type(task).__name__}"
        raise InvalidValueError(called, answer, "a dictionary of arrays by name")
    shape, found = (count,), dict(answer)
    for key, value in found.items():
        # Two dozen at every step, and mostly what they should be.
        if type(value) is not np.ndarray or value.shape != shape:
            found[key] = as_numbers(value, shape, task, f"{name} {key!r}")
    return found
