"""What every task is: what chance decides, what is asked, what is observed and rewarded."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from fbid_gym.motions.gait.command import Steering
from fbid_gym.motions.target import MotionKind, planned_kind
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target
from fbid_gym.robots.terrain.grid import HeightGrid
from fbid_gym.tasks.body import Body
from fbid_gym.tasks.observation import Groups
from fbid_gym.tasks.outcome import Outcome
from fbid_gym.tasks.plan import Plan
from fbid_gym.tasks.pushes import Pushes
from fbid_gym.tasks.reward import Terms
from fbid_gym.tasks.start import Start


class Now(NamedTuple):
    """What a target may depend on at a control tick, beside the plan.

    Attributes:
        state: of the robots.
        terms: returns the dynamics at this state.
        steering: what the policy changes of a gait.
        memory: of the robots, what `Task.memory` began; updated.
    """

    state: RobotState
    terms: Callable[[], DynamicsTerms]
    steering: Steering
    memory: Memory


class Task(Protocol):
    """A task for one kind of robot.

    A task is immutable and serves any number of robots: what differs between them lies in a `Plan`
    that the caller keeps.
    """

    @property
    def body(self) -> Body:
        """The robot, and what every task sees of it."""
        ...

    @property
    def seconds(self) -> float:
        """Length of an episode."""
        ...

    @property
    def pushes(self) -> Pushes:
        """The disturbances; their plan is part of the task's."""
        ...

    @property
    def kind(self) -> MotionKind:
        """What kind of motion it asks for."""
        ...

    @property
    def derived(self) -> Mapping[str, Any]:
        """What the options mean that a robot decides where the user does not."""
        ...

    @property
    def observation_groups(self) -> Groups:
        """The table of the observation: what the policy sees, a group beside the other."""
        ...

    @property
    def reward_terms(self) -> Terms:
        """The table of the reward, before a user changes weights and scales."""
        ...

    @property
    def tolerance(self) -> float:
        """Error of the velocity, m/s, up to which a robot follows its commands."""
        ...

    def on(self, ground: HeightGrid) -> "Task":
        """Return the task on other ground."""
        ...

    def draw(self, rng: np.random.Generator) -> Plan:
        """Draw all that chance decides about one episode; "qpos" and "qvel" are its start."""
        ...

    def memory(self, terms: DynamicsTerms) -> Memory:
        """Return what is remembered of robots that begin an episode where they are."""
        ...

    def advance(self, plan: Plan, now: Now) -> None:
        """Go on by a control tick: the one method that writes to the memory."""
        ...

    def target(self, plan: Plan, now: Now) -> Target:
        """Return what the robots shall do at this control tick, once it has begun."""
        ...

    def measure(self, outcome: Outcome, plan: Plan, memory: Memory) -> Any:
        """Return what observation, reward and metrics are made of, at the end of a policy step.

        Nothing changes by it: the same arguments give the same measures.

        Args:
            outcome: what the step did.
            plan: of the robots.
            memory: of the robots.

        Returns:
            A named tuple of arrays with a row for each robot. Those of this package have the
            `outcome`, and what lengths, speeds and torques are measured by, as `units`.
        """
        ...

    def metrics(self, measured: Any) -> dict[str, np.ndarray]:
        """Return physical quantities for evaluation, name -> (N,), of what was measured."""
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class Episode:
    """What tasks have in common: a robot, how long it is at it, and what happens to it.

    Attributes:
        body: the robot.
        seconds: length of an episode.
        hz: control ticks per second.
        pushes: the disturbances.
        start: how an episode begins.
        derived: what the options mean that a robot decides where the user does not.
    """

    body: Body
    seconds: float
    hz: int
    pushes: Pushes
    start: Start
    derived: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def from_episode(cls, episode: "Episode", **own: Any) -> Self:
        """Build a task of this class: with such episodes, and its own attributes."""
        return cls(**{**vars(episode), **own})

    def begin(self, rng: np.random.Generator, qpos: np.ndarray, qvel: np.ndarray) -> Plan:
        """Draw the state in which an episode begins, near a posture, and its pushes.

        Args:
            rng: of this episode.
            qpos: (nq,) posture, see `Start.draw`.
            qvel: (nv,) its velocity.
        """
        qpos, qvel = self.start.draw(self.body.robot, qpos, qvel, rng)
        return {"qpos": qpos, "qvel": qvel, **self.pushes.draw(rng, self.seconds, self.hz)}

    def begin_at_home(self, rng: np.random.Generator) -> Plan:
        """Draw the same, near home and at rest."""
        robot = self.body.robot
        return self.begin(rng, robot.home_qpos, np.zeros(robot.nv))


@dataclass(frozen=True, eq=False, kw_only=True)
class PlannedEpisode(Episode):
    """What tasks have in common whose motion is planned beforehand, standing among them."""

    @property
    def kind(self) -> MotionKind:
        """See `Task.kind`."""
        return planned_kind(self.body.robot)

    @property
    def tolerance(self) -> float:
        """See `Task.tolerance`: there are no commands."""
        return np.inf

    def on(self, ground: HeightGrid) -> Self:
        """Return the task itself: it does not see the ground."""
        return self

    def memory(self, terms: DynamicsTerms) -> Memory:
        """Nothing is remembered."""
        return {}

    def advance(self, plan: Plan, now: Now) -> None:
        """Nothing goes on."""
