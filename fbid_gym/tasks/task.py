"""What every task is: what chance decides, what is asked, how it is judged."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from fbid_gym.motions.gait.command import Steering
from fbid_gym.motions.target import MotionKind
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target
from fbid_gym.tasks.body import Body
from fbid_gym.tasks.outcome import Outcome
from fbid_gym.tasks.plan import Plan
from fbid_gym.tasks.pushes import Pushes


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
    def observation_names(self) -> tuple[str, ...]:
        """One name per entry of the observation."""
        ...

    @property
    def observation_bound(self) -> np.ndarray:
        """Largest size of each entry of the observation, (O,); observations are clipped to it."""
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

    def observe(self, outcome: Outcome, plan: Plan, memory: Memory) -> np.ndarray:
        """Return what the policy sees: (N, O), named by `observation_names`."""
        ...

    def reward(
        self, outcome: Outcome, plan: Plan, memory: Memory
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Judge a policy step.

        Args:
            outcome: what it did.
            plan: of the robots.
            memory: of the robots; updated.

        Returns:
            terms: name -> (N,), each in [0, its weight].
            metrics: name -> (N,) physical quantities for evaluation.
        """
        ...
