"""Tasks: initial state, commands, disturbances, observation, reward."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from fbid_gym.checks import check_choices
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Choice, Pair, check_call, check_own_name, grouped, options_of
from fbid_gym.robots import Robot
from fbid_gym.tasks.balance import Balance
from fbid_gym.tasks.body import Body
from fbid_gym.tasks.crawl import crawl
from fbid_gym.tasks.observation import Group
from fbid_gym.tasks.outcome import Outcome
from fbid_gym.tasks.plan import Plan, Pushes, Start, check_schedule
from fbid_gym.tasks.reward import SCALE, WEIGHT, Term, Terms, bell
from fbid_gym.tasks.squat import squat
from fbid_gym.tasks.step import step
from fbid_gym.tasks.task import Episode, Now, PlannedEpisode, Task
from fbid_gym.tasks.tracking import Tracking
from fbid_gym.tasks.walk import Walk

__all__ = [
    "TASKS",
    "Balance",
    "Body",
    "Episode",
    "Group",
    "Now",
    "Outcome",
    "Plan",
    "PlannedEpisode",
    "Pushes",
    "Start",
    "Task",
    "Term",
    "Tracking",
    "Walk",
    "bell",
    "make_task",
    "register_reward_term",
    "register_task",
    "reward_table",
    "task_options",
]


_PUSH = Pair(0.0, 100.0)


class TaskKind(NamedTuple):
    """A task before it has a robot."""

    of: Callable[..., Task]  # its constructor, called as `(episode, **options)`
    # (least, most) size of a push by default, share of the robot's weight.
    push: tuple[float, float]
    terms: Terms  # of its reward; empty for a user's task, which tells them once it has a robot
    own_terms: dict[str, Term]  # those that a user adds to them


TASKS: dict[str, TaskKind] = {
    "balance": TaskKind(Balance.of, (0.04, 0.36), Balance.reward_terms, {}),
    "squat": TaskKind(squat, (0.0, 0.0), Tracking.reward_terms, {}),
    "step": TaskKind(step, (0.02, 0.15), Tracking.reward_terms, {}),
    "crawl": TaskKind(crawl, (0.0, 0.0), Tracking.reward_terms, {}),
    "walk": TaskKind(Walk.of, (0.0, 0.4), Walk.reward_terms, {}),
}
"""Name of a task -> its kind."""

_BUILT_IN = tuple(TASKS)


def register_task(
    name: str, of: Callable[..., Task], *, push: tuple[float, float] = (0.0, 0.0)
) -> None:
    """Make a task of your own known as `task="name"`; a second time replaces it.

    Args:
        name: not that of a task of this package.
        of: its constructor, called with an `Episode` and `**options`: these are its keyword-only
            arguments, see `fbid_gym.options`.
        push: (least, most) size of a push by default, share of the robot's weight.

    Raises:
        FbidError: another name, another constructor or another size is expected.
    """
    check_own_name("task", name, _BUILT_IN)
    check_call(name, of, ("episode",))
    TASKS[name] = TaskKind(of, _PUSH.check("push", push), {}, {})


def register_reward_term(
    task: str, name: str, function: Any, weight: float, scale: float | None = None, unit: str = ""
) -> None:
    """Add a term of your own to the reward of a task; a second time replaces it.

    It is in every environment of the task that is made from now on, and `reward_weights` and
    `reward_scales` know it. `info` has it as `reward_<name>`.

    Args:
        task: one of `TASKS`.
        name: not that of a term of this package.
        function: takes what the task measured of N robots (`WalkMeasures` and the like), and the
            scale if there is one; returns (N,), at best from 0 to 1. It changes nothing.
        weight: by which that is multiplied.
        scale: of the function, such as the width of its bell.
        unit: of the scale, in words.

    Raises:
        FbidError: another task, name, function, weight or scale is expected.
    """
    kind = task_kind(task)
    check_own_name("reward term", name, tuple(kind.terms))
    if not callable(function):
        expected = "a function of what was measured, and of the scale if there is one"
        raise InvalidValueError(f"function of reward term {name!r}", function, expected)
    weight = WEIGHT.check(f"weight of reward term {name!r}", weight)
    if scale is not None:
        scale = SCALE.check(f"scale of reward term {name!r}", scale)
    kind.own_terms[name] = Term(function, weight, scale, unit)


def reward_table(
    name: str, task: Task, weights: Mapping[str, float], scales: Mapping[str, float]
) -> dict[str, Term]:
    """Return the terms of a task's reward: its own and the user's, with the user's numbers.

    Weights and scales by the name of a term stand instead of those in its table.

    Raises:
        FbidError: a task of a user's whose table is none, a name of no term, or of one without a
            scale; names those there are.
    """
    terms = task.reward_terms
    if not isinstance(terms, Mapping) or not all(isinstance(t, Term) for t in terms.values()):
        called = f"reward_terms of {type(task).__name__}"
        raise InvalidValueError(called, terms, "a dictionary from names to Terms")
    table = {**terms, **task_kind(name).own_terms}
    scaled = [known for known, term in table.items() if term.scale is not None]
    check_choices(f"reward term of task {name!r}", weights, table)
    check_choices(f"reward term with a scale of task {name!r}", scales, scaled)
    for term, weight in ({k: t.weight for k, t in table.items()} | dict(weights)).items():
        weight = WEIGHT.check(f"weight of reward term {term!r}", weight)
        table[term] = table[term]._replace(weight=weight)
    for term, scale in scales.items():
        table[term] = table[term]._replace(scale=scale)
    return table


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
    """Build a task, one of `TASKS`, with episodes of `seconds` and `hz` control ticks per second.

    Options are its arguments by name, see `task_options`.

    Raises:
        FbidError: unknown task, unknown option or invalid value; the message names the choices.
    """
    given = dict(options or {})
    check_choices(f"option of task {name!r}", given, task_options(name))
    check_schedule("push_interval", pushes.interval, seconds)
    of = task_kind(name).of
    episode = Episode(body=Body.of(robot), seconds=seconds, hz=hz, pushes=pushes, start=start)
    return of(episode, **grouped(of, given))


def task_kind(name: str) -> TaskKind:
    """Return the kind of a task."""
    return TASKS[Choice(TASKS).check("task", name)]
