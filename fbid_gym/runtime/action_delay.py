"""Actions on their way from the policy to the action layer.

An action that was chosen at the beginning of a policy step arrives a robot's own delay later, in
the middle of a step perhaps, and holds until the next one arrives. Until the first one does there
is the zero action, which asks for the reference.
"""

from dataclasses import dataclass

import numpy as np

from fbid_gym.runtime.rates import Rates


@dataclass(frozen=True, eq=False)
class ActionDelay:
    """Of N robots."""

    rates: Rates  # of control and policy
    # All that changes, by name: "action" (N, H, A), the last ones chosen, newest first; "ticks"
    # (N,) int64, the delays in control ticks.
    arrays: dict[str, np.ndarray]

    @classmethod
    def of(cls, num_robots: int, num_actions: int, rates: Rates, longest: float) -> "ActionDelay":
        """Return robots without delay, who may get one of at most `longest` s."""
        steps = -(-round(longest * rates.control) // rates.ticks)
        return cls(
            rates,
            {
                "action": np.zeros((num_robots, 1 + steps, num_actions)),
                "ticks": np.zeros(num_robots, np.int64),
            },
        )

    def begin(self, ids: np.ndarray, seconds: np.ndarray) -> None:
        """Begin episodes of robots (K,) with delays (K,) s, in whole control ticks."""
        self.arrays["action"][ids] = 0.0
        self.arrays["ticks"][ids] = np.round(seconds * self.rates.control)

    def send(self, action: np.ndarray) -> None:
        """Take the actions (N, A) that were chosen for the policy step that begins."""
        chosen = self.arrays["action"]
        chosen[:, 1:] = chosen[:, :-1]
        chosen[:, 0] = action

    def arrivals(self) -> set[int]:
        """Return the ticks of a policy step from which on some robot has another action."""
        return {0, *(self.arrays["ticks"] % self.rates.ticks).tolist()}

    def arrived(self, tick: int) -> np.ndarray:
        """Return the actions (N, A) that hold at this tick of the policy step."""
        chosen, ticks = self.arrays.values()
        steps_ago = -((tick - ticks) // self.rates.ticks)
        return chosen[np.arange(len(chosen)), steps_ago]
