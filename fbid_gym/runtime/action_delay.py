"""Actions on their way from the policy to the action layer.

An action that was chosen at the beginning of a policy step arrives a robot's own delay later, in
the middle of a step perhaps, and holds until the next one arrives. Until the first one does there
is the zero action, which asks for the reference.
"""

import numpy as np

from fbid_gym.runtime.rates import Rates


class ActionDelay:
    """Actions on their way to N robots."""

    def __init__(self, num_robots: int, num_actions: int, rates: Rates, longest: float) -> None:
        """Begin without delay; robots may get one of at most `longest` s."""
        self._rates = rates  # of control and policy
        steps = -(-round(longest * rates.control) // rates.ticks)
        # All that changes, by name: the last actions chosen, newest first; and the delays in
        # control ticks.
        self.arrays = {
            "action": np.zeros((num_robots, 1 + steps, num_actions)),
            "ticks": np.zeros(num_robots, np.int64),
        }

    def begin(self, ids: np.ndarray, seconds: np.ndarray) -> None:
        """Begin episodes of robots (K,) with delays (K,) s, in whole control ticks."""
        self.arrays["action"][ids] = 0.0
        self.arrays["ticks"][ids] = np.round(seconds * self._rates.control)

    def send(self, action: np.ndarray) -> None:
        """Take the actions (N, A) that were chosen for the policy step that begins."""
        chosen = self.arrays["action"]
        chosen[:, 1:] = chosen[:, :-1]
        chosen[:, 0] = action

    def arrivals(self) -> set[int]:
        """Return the ticks of a policy step from which on some robot has another action."""
        return {0, *(self.arrays["ticks"] % self._rates.ticks).tolist()}

    def arrived(self, tick: int) -> np.ndarray:
        """Return the actions (N, A) that hold at this tick of the policy step."""
        chosen, ticks = self.arrays.values()
        steps_ago = -((tick - ticks) // self._rates.ticks)
        return chosen[np.arange(len(chosen)), steps_ago]
