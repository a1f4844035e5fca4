"""The interface of a task: random draws, targets, measurements, observation, reward."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from fbid_gym.motions.gait.command import Steering
from fbid_gym.motions.target import MotionKind, planned_kind
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target
from fbid_gym.tasks.body import Body
from fbid_gym.tasks.observation import Groups
from fbid_gym.tasks.outcome import Outcome
from fbid_gym.tasks.plan import Plan, Pushes, Start
from fbid_gym.tasks.reward import Terms

Ground = Callable[[np.ndarray], np.ndarray]
"""Tells how high the ground is, (N, K) m, below points (N, K, 2 or 3) m of the world."""


class Now(NamedTuple):
    """Inputs of a target at a control tick, beside the plan.

    Attributes:
        state: of the robots, as controllers know it.
        terms: returns the dynamics at this state.
        steering: the policy's changes to a gait.
        memory: of the robots, begun by `Task.memory`; updated.
        actual: returns the dynamics where the robots are. The same function as `terms` where
            controllers know that; where they estimate it, terrain and measures need this one.
    """

    state: RobotState
    terms: Callable[[], DynamicsTerms]
    steering: Steering
    memory: Memory
    actual: Callable[[], DynamicsTerms]


class Task(Protocol):
    """A task for one kind of robot.

    A task is immutable and serves any number of robots; the caller keeps a `Plan` of each.
    """

    @property
    def body(self) -> Body:
        """The robot, with the observations that all tasks share."""

    @property
    def seconds(self) -> float:
        """Length of an episode."""

    @property
    def pushes(self) -> Pushes:
        """The disturbances; their plan is part of the task's."""

    @property
    def kind(self) -> MotionKind:
        """The kind of motion of the task."""

    @property
    def derived(self) -> Mapping[str, Any]:
        """Values of the options that derive from the robot where the user gives none."""

    @property
    def commands(self) -> Mapping[str, Any]:
        """Ranges of the commands: unit with direction -> (least, most)."""

    @property
    def observation_groups(self) -> Groups:
        """The table of the observation, group after group."""

    @property
    def reward_terms(self) -> Terms:
        """The table of the reward, before a user changes weights and scales."""

    @property
    def tolerance(self) -> float:
        """Error of the velocity, m/s, up to which a robot follows its commands."""

    def on(self, ground: Ground) -> "Task":
        """Return the task on other ground."""

    def draw(self, rng: np.random.Generator) -> Plan:
        """Draw all that chance decides about one episode; "qpos" and "qvel" are its start."""

    def memory(self, terms: DynamicsTerms) -> Memory:
        """Return the memory of robots that begin an episode where they are."""

    def advance(self, plan: Plan, now: Now) -> None:
        """Go on by a control tick: the one method that writes to the memory."""

    def target(self, plan: Plan, now: Now) -> Target:
        """Return the desired motion at this control tick."""

    def measure(self, outcome: Outcome, plan: Plan, memory: Memory) -> Any:
        """Return the measurements for observation, reward and metrics, at the end of a policy step.

        Nothing changes by it: the same arguments give the same measures. They are a named tuple of
        arrays with a row for each robot. Those of this package have the `outcome`, and as `units`
        those of lengths, speeds and torques.
        """

    def metrics(self, measured: Any) -> dict[str, np.ndarray]:
        """Return physical quantities for evaluation from the measurements, name -> (N,)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Episode:
    """The part that all tasks share: robot, length, start and pushes.

    Attributes:
        body: the robot.
        seconds: length of an episode.
        hz: control ticks per second.
        pushes: the disturbances.
        start: how an episode begins.
        derived: values of the options that derive from the robot where the user gives none.
        commands: see `Task.commands`.
    """

    body: Body
    seconds: float
    hz: int
    pushes: Pushes
    start: Start
    derived: Mapping[str, Any] = field(default_factory=dict)
    commands: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def from_episode(cls, episode: "Episode", **own: Any) -> Self:
        """Build a task of this class: with such episodes, and its own attributes."""
        return cls(**{**vars(episode), **own})

    def begin(self, rng: np.random.Generator, qpos: np.ndarray, qvel: np.ndarray) -> Plan:
        """Draw the state in which an episode begins, and its pushes; see `Start.draw`."""
        qpos, qvel = self.start.draw(self.body.robot, qpos, qvel, rng)
        return {"qpos": qpos, "qvel": qvel, **self.pushes.draw(rng, self.seconds, self.hz)}

    def begin_at_home(self, rng: np.random.Generator) -> Plan:
        """Draw the same, near home and at rest."""
        robot = self.body.robot
        return self.begin(rng, robot.home_qpos, np.zeros(robot.nv))


@dataclass(frozen=True, eq=False, kw_only=True)
class PlannedEpisode(Episode):
    """The part that tasks with a planned motion share; standing is one."""

    @property
    def kind(self) -> MotionKind:
        """See `Task.kind`."""
        return planned_kind(self.body.robot)

    @property
    def tolerance(self) -> float:
        """See `Task.tolerance`: there are no commands."""
        return np.inf

    def on(self, ground: Ground) -> Self:
        """Return the task itself: it does not see the ground."""
        return self

    def memory(self, terms: DynamicsTerms) -> Memory:
        """Return an empty memory."""
        return {}

    def advance(self, plan: Plan, now: Now) -> None:
        """Do nothing: planned motions have no state."""
