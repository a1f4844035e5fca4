"""What a robot is asked to do: initial state, commands, disturbances, observation, reward."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from fbid_gym.checks import check_choices
from fbid_gym.options import (
    Choice,
    Pair,
    check_call,
    check_own_name,
    grouped,
    options_of,
)
from fbid_gym.robots import Robot
from fbid_gym.tasks.balance import Balance
from fbid_gym.tasks.body import Body
from fbid_gym.tasks.crawl import crawl
from fbid_gym.tasks.outcome import Outcome
from fbid_gym.tasks.plan import Plan, check_schedule
from fbid_gym.tasks.pushes import Pushes
from fbid_gym.tasks.squat import squat
from fbid_gym.tasks.start import Start
from fbid_gym.tasks.step import step
from fbid_gym.tasks.task import Now, Task
from fbid_gym.tasks.walk import Walk

__all__ = [
    "TASKS",
    "Body",
    "Now",
    "Outcome",
    "Plan",
    "Pushes",
    "Start",
    "Task",
    "Walk",
    "make_task",
    "register_task",
    "task_options",
]


_PUSH = Pair(0.0, 100.0)


class TaskKind(NamedTuple):
    """A task before it has a robot.

    Attributes:
        of: its constructor, called as `(robot, seconds, hz, pushes, start, **options)`.
        push: (least, most) size of a push by default, share of the robot's weight.
    """

    of: Callable[..., Task]
    push: tuple[float, float]


TASKS: dict[str, TaskKind] = {
    "balance": TaskKind(Balance.of, (0.04, 0.36)),
    "squat": TaskKind(squat, (0.0, 0.0)),
    "step": TaskKind(step, (0.02, 0.15)),
    "crawl": TaskKind(crawl, (0.0, 0.0)),
    "walk": TaskKind(Walk.of, (0.0, 0.4)),
}
"""Name of a task -> what it is."""

_BUILT_IN = tuple(TASKS)


def register_task(
    name: str, of: Callable[..., Task], *, push: tuple[float, float] = (0.0, 0.0)
) -> None:
    """Make a task of your own known as `task="name"`; a second time replaces it.

    Args:
        name: not that of a task of this package.
        of: its constructor, called as `(robot, seconds, hz, pushes, start, **options)`. Its options
            are its keyword-only arguments, see `fbid_gym.options`.
        push: (least, most) size of a push by default, share of the robot's weight.

    Raises:
        FbidError: another name, another constructor or another size is expected.
    """
    check_own_name("task", name, _BUILT_IN)
    check_call(name, of, ("robot", "seconds", "hz", "pushes", "start"))
    TASKS[name] = TaskKind(of, _PUSH.check("push", push))


def task_options(name: str) -> dict[str, Any]:
    """Return the options of a task with their defaults."""
    return {option.name: option.default for option in options_of(task_kind(name).of).values()}


def make_task(
    name: str,
    robot: Robot,
    seconds: float,
    hz: int,
    pushes: Pushes,
    start: Start,
    options: Mapping[str, Any] | None = None,
) -> Task:
    """Build a task.

    Args:
        name: one of `TASKS`.
        robot: who shall do it.
        seconds: length of an episode.
        hz: control ticks per second.
        pushes: the disturbances.
        start: how an episode begins.
        options: arguments of the task by name, see `task_options`.

    Raises:
        FbidError: unknown task, unknown option or invalid value; the message names the choices.
    """
    given = dict(options or {})
    check_choices(f"option of task {name!r}", given, task_options(name))
    check_schedule("push_interval", pushes.interval, seconds)
    of = task_kind(name).of
    return of(robot, seconds, hz, pushes, start, **grouped(of, given))


def task_kind(name: str) -> TaskKind:
    """Return what a task is."""
    return TASKS[Choice(TASKS).check("task", name)]
