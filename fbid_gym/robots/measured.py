"""Measurements of a robot, taken once and forgotten with it."""

from collections.abc import Callable
from functools import update_wrapper
from typing import Any, Concatenate, ParamSpec, TypeVar

from fbid_gym.robots.robot import Robot

P = ParamSpec("P")
Found = TypeVar("Found")

_MOST = 16  # results of a function that are kept of one robot


def once_for_robot(
    measure: Callable[Concatenate[Robot, P], Found],
) -> Callable[Concatenate[Robot, P], Found]:
    """Keep what a function finds of a robot, for as long as the robot lives.

    `functools.lru_cache` would keep robots alive, their meshes and worlds with them. What it takes
    beside the robot can be hashed.
    """

    def measure_once(robot: Robot, *rest: P.args, **options: P.kwargs) -> Found:
        found = vars(robot).setdefault(f"_once {measure.__module__}.{measure.__qualname__}", {})
        key: Any = (rest, *options.items())
        if key not in found:
            if len(found) >= _MOST:
                found.pop(next(iter(found)))
            found[key] = measure(robot, *rest, **options)
        result: Found = found[key]
        return result

    return update_wrapper(measure_once, measure)
