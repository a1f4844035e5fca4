"""The interface of action layers: a map from a policy's action to joint torques, tick by tick."""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target

GetTerms = Callable[[], DynamicsTerms]
"""Returns the dynamics at the robots' state, which are computed once somebody asks."""


class ActionLayer(Protocol):
    """Turns actions in [-1, 1] into joint torques at the control rate.

    A layer is immutable and serves any number of robots: what it remembers of each lies in a
    `Memory` that the caller keeps, so that resetting one robot is resetting one row. In every layer
    the zero action means "follow the task's target as well as this layer can"; where the task is to
    stand, that is to hold the home posture.

    It may have `drive_torque(state)`: the part, (N, n) N·m, that drives make without a delay.
    """

    @property
    def action_names(self) -> tuple[str, ...]:
        """What each entry of the action commands, with its scale and unit."""

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """Names of the memory entries, each (N,), that are worth reporting."""

    def memory(self, num_robots: int) -> Memory:
        """Return the memory of robots that have not moved yet."""

    def torque(
        self, action: np.ndarray, state: RobotState, target: Target, terms: GetTerms, memory: Memory
    ) -> np.ndarray:
        """Return joint torques.

        Args:
            action: (N, A) in [-1, 1].
            state: of the robots, now.
            target: what they shall do, now.
            terms: returns the dynamics at this state; not called by layers that need no model.
            memory: of the robots; updated.

        Returns:
            (N, n) N·m, before the torque limits.
        """


class Memoryless:
    """Shared base of the layers without a memory."""

    diagnostics: tuple[str, ...] = ()

    def memory(self, num_robots: int) -> Memory:
        """Nothing to remember."""
        return {}


def scaled_names(
    names: Sequence[str], scale: np.ndarray, linear: str, angular: str
) -> tuple[str, ...]:
    """Return names of actions on a body, with their scales (6,) and units, linear ones first."""
    units = [linear] * 3 + [angular] * 3
    return tuple(
        f"{name} (x {size:.3g} {unit})"
        for name, size, unit in zip(names, scale, units, strict=True)
    )
