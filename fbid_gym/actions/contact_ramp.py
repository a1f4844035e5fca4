"""Contact switches without a jump in the torque."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.layer import Memory

_UNKNOWN = -1


@dataclass(frozen=True)
class ContactRamp:
    """Leads the torque of a layer from one set of contacts to the next.

    A law of contacts c gives torques tau_c. When they switch from b to c, the ramp adds the
    difference tau_b - tau_c of that instant to tau_c, and takes it away again linearly in time:
    what it adds is (1 - s) (tau_b - tau_c), s from 0 to 1. So the torque goes on from where it was,
    feedback acts through the new contacts at once, and the load of a foot fades in or out. A switch
    during a ramp adds its own difference to what is left. Each switch costs the law a second time,
    for the robots that switch; the ticks between cost nothing.

    Attributes:
        ticks: control ticks of a ramp.
    """

    ticks: int

    def memory(self, num_robots: int, num_points: int, num_joints: int) -> Memory:
        """Return what is remembered of robots that have not moved yet."""
        return {
            "ramp_contacts": np.full((num_robots, num_points), _UNKNOWN, np.int8),
            "ramp_ticks": np.zeros(num_robots, np.int64),
            "ramp_torque": np.zeros((num_robots, num_joints)),
        }

    def torque(
        self,
        torque: np.ndarray,
        active: np.ndarray,
        law: Callable[[np.ndarray, np.ndarray], np.ndarray],
        memory: Memory,
    ) -> np.ndarray:
        """Return the torques to apply.

        Args:
            torque: (N, n) of the law with the contacts `active`.
            active: (N, P) bool, which points are in contact now.
            law: returns the torques (R, n) of R robots, given by their indices (R,), at this tick
                with contacts (R, P).
            memory: of the robots; updated.

        Returns:
            (N, n).
        """
        before, left, added = (memory[f"ramp_{key}"] for key in ("contacts", "ticks", "torque"))
        memory["ramp_contacts"] = active.astype(np.int8)
        if left.any():
            left = np.maximum(left - 1, 0)
            added = added * (left / (left + 1.0))[:, None]
        switched = np.flatnonzero((active != before).any(axis=1) & (before[:, 0] != _UNKNOWN))
        if len(switched):
            left, added = left.copy(), added.copy()
            added[switched] += law(switched, before[switched].astype(bool)) - torque[switched]
            left[switched] = self.ticks
        memory["ramp_ticks"], memory["ramp_torque"] = left, added
        return torque + added if left.any() else torque
