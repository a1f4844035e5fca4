"""Contact switches without a jump in the torque."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.layer import Memory
from fbid_gym.compiled import kernel

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
            "ramp_contacts": np.full((num_robots, num_points), _UNKNOWN, np.int64),
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
        contacts, left, added = (memory[f"ramp_{key}"] for key in ("contacts", "ticks", "torque"))
        switched, result = np.empty(len(torque), bool), np.empty(torque.shape)
        _fade(torque, active, contacts, left, added, switched, result)
        if switched.any():
            rows = np.flatnonzero(switched)
            added[rows] += law(rows, contacts[rows].astype(bool)) - torque[rows]
            left[rows], contacts[rows] = self.ticks, active[rows]
            result[rows] = torque[rows] + added[rows]
        return result


@kernel
def _fade(
    torque: np.ndarray,
    active: np.ndarray,
    contacts: np.ndarray,
    left: np.ndarray,
    added: np.ndarray,
    switched: np.ndarray,
    result: np.ndarray,
) -> None:
    """Go on with the ramps of N robots by a tick, and find where contacts have switched.

    Args:
        torque: (N, n) of the law.
        active: (N, P) bool, which points are in contact now.
        contacts: (N, P) which were a tick ago, or `_UNKNOWN`; then the present ones are taken.
        left: (N,) ticks of the ramp; updated.
        added: (N, n) what the ramp adds; updated.
        switched: (N,) bool, to be found.
        result: (N, n) the sum of torque and ramp.
    """
    for i in range(len(torque)):
        fading = left[i] > 0
        if fading:
            left[i] -= 1
            share = left[i] / (left[i] + 1.0)
            for j in range(torque.shape[1]):
                added[i, j] *= share
        for j in range(torque.shape[1]):
            result[i, j] = torque[i, j] + (added[i, j] if fading else 0.0)
        unknown, switched[i] = contacts[i, 0] == _UNKNOWN, False
        for j in range(active.shape[1]):
            if unknown:
                contacts[i, j] = active[i, j]
            elif contacts[i, j] != active[i, j]:
                switched[i] = True
