"""Tasks whose motion is planned ahead: it depends on time, not on what the robot does."""

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from fbid_gym.motions.gait.command import Steering
from fbid_gym.quantities import DynamicsTerms, Memory, Reference, RobotState
from fbid_gym.tasks.plan import Plan


class Ahead(ABC):
    """What a `Task` is that plans ahead: nothing is remembered."""

    @abstractmethod
    def planned(self, plan: Plan, tick: np.ndarray) -> Reference:
        """Return what the robots shall do at control ticks (N,)."""

    def memory(self, terms: DynamicsTerms) -> Memory:
        """Nothing."""
        return {}

    def reference(
        self,
        plan: Plan,
        state: RobotState,
        terms: Callable[[], DynamicsTerms],
        steering: Steering,
        memory: Memory,
    ) -> Reference:
        """Return what the action layers follow at this control tick."""
        return self.planned(plan, state.tick)
