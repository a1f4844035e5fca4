"""The loop from state to torque: task, layer and delay of N robots, tick by tick.

Environments run it on a simulation, `fbid_gym.runtime.Controller` on whatever has sensors. It knows
no physics: who runs it says where the robots are.
"""

from typing import Any

import numpy as np

from fbid_gym.actions.layer import GetTerms
from fbid_gym.motions.gait.command import Steering
from fbid_gym.quantities import DynamicsTerms, RobotState
from fbid_gym.runtime import answers
from fbid_gym.runtime.action_delay import ActionDelay
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.runtime.effort import Effort
from fbid_gym.runtime.observer import Observer
from fbid_gym.tasks import Plan, Task
from fbid_gym.tasks.outcome import Outcome
from fbid_gym.tasks.task import Now


class ControlLoop:
    """A task and an action layer at work on N robots.

    Attributes:
        rates: of control and policy.
        task: the task.
        layer: the action layer.
        additions: what of an action comes after the layer's.
        plan: of the present episodes; a row for each robot, as in all that follows.
        memory: of the layer.
        planned: memory of the task.
        delay: actions on their way.
        num_actions: A, of layer and additions.
        observer: of the robots.
    """

    def __init__(
        self,
        config: EnvConfig,
        task: Task,
        drawn: Plan,
        terms: DynamicsTerms,
        observer: Observer,
        longest_delay: float = 0.0,
    ) -> None:
        """Set the robots to work; `begin` their episodes before the first tick.

        Args:
            config: rates, action layer and its options.
            task: the task.
            drawn: an episode of it, which all robots have at first.
            terms: where the N robots are.
            observer: of them.
            longest_delay: s, of an action.

        Raises:
            FbidError: options that the layer does not have; a task or a layer of the user's that is
                not what it promises.
        """
        count, robot = len(terms.com), task.body.robot
        self.rates, self.task, self.observer = config.rates(), task, observer
        self.layer, self.additions = config.layer(robot, task)
        self.plan = {name: np.repeat(value[None], count, axis=0) for name, value in drawn.items()}
        self.memory = self.layer.memory(count)
        answers.check_layer(self.layer, self.memory, count)
        planned = task.memory(terms)
        answers.check_memory(planned, count, task)
        self.planned = {name: value.copy() for name, value in planned.items()}
        self._num_own, self.num_actions = len(self.layer.action_names), len(self.action_names)
        self.delay = ActionDelay(count, self.num_actions, self.rates, longest_delay)
        self._torque_shape = count, robot.num_joints

    @property
    def action_names(self) -> tuple[str, ...]:
        """What each entry of the action commands: of the layer, then what is added."""
        return (*self.layer.action_names, *self.additions.action_names)

    def begin(self, ids: np.ndarray, terms: DynamicsTerms) -> None:
        """Have robots `ids` (K,), which are at `terms`, K rows, forget, and begin their plans."""
        for name, value in self.layer.memory(len(ids)).items():
            self.memory[name][ids] = value
        for name, value in self.task.memory(terms).items():
            self.planned[name][ids] = value

    def send(self, action: np.ndarray) -> None:
        """Take the actions (N, A) that were chosen for the policy step that begins."""
        self.delay.send(action)
        self._arrivals = self.delay.arrivals()

    def arrived(self, tick: int) -> tuple[np.ndarray, Steering, np.ndarray | None]:
        """Return what holds at a tick of the policy step: the layer's action, steering, torques."""
        own, added = np.hsplit(self.delay.arrived(tick), [self._num_own])
        return np.ascontiguousarray(own), *self.additions.split(added)

    def torque(self, tick: int, state: RobotState, terms: GetTerms, actual: GetTerms) -> np.ndarray:
        """Return the torques (N, n) N·m of a tick, before limits; task and layer go on by it.

        Args:
            tick: of the policy step, the first is 0; after `send`.
            state: of the robots, measured or estimated.
            terms: returns the dynamics at this state.
            actual: returns them where the robots are, see `Now`.
        """
        if tick in self._arrivals:
            self._own, self._steering, self._residual = self.arrived(tick)
        now = Now(state, terms, self._steering, self.planned, actual)
        self.task.advance(self.plan, now)
        target = self.task.target(self.plan, now)
        torque = self.layer.torque(self._own, state, target, terms, self.memory)
        torque = answers.as_numbers(torque, self._torque_shape, self.layer, "torque")
        return torque if self._residual is None else torque + self._residual

    def drive_torque(self, state: RobotState) -> np.ndarray:
        """Return what of the layer's torques the motors' drives make themselves, (N, n) N·m."""
        make = getattr(self.layer, "drive_torque", None)  # those of users may have none
        made = None if make is None else make(state)
        made = np.zeros(self._torque_shape) if made is None else made
        return answers.as_numbers(made, self._torque_shape, self.layer, "drive_torque")

    def outcome(
        self, state: RobotState, terms: DynamicsTerms, effort: Effort, sums: dict[str, np.ndarray]
    ) -> Outcome:
        """Return the outcome of a policy step, from state and terms at its end.

        The effort is that of its ticks; the sums are "distance" and "energy" (N,), see `Outcome`.
        """
        ticks = self.rates.ticks
        square = effort.torque_square / (ticks * effort.torque.shape[1])
        return Outcome(
            state=state,
            terms=terms,
            posture=self.task.body.posture(state, terms),
            torque=effort.torque.copy(),
            torque_rms=np.sqrt(square),
            power=effort.power / ticks,
            **{name: total.copy() for name, total in sums.items()},
            actual=terms,
        )

    def measure(self, outcome: Outcome) -> Any:
        """Return what observation, reward and metrics are made of."""
        return self.task.measure(outcome, self.plan, self.planned)

    def believed(self, outcome: Outcome, state: RobotState, terms: DynamicsTerms) -> Outcome:
        """Return an outcome as robots believe it to be, who take themselves to be at a state."""
        posture = self.task.body.posture(state, terms)
        return outcome._replace(state=state, terms=terms, posture=posture)
