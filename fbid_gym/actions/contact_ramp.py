"""Contact switches without a jump in the torque."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.quantities import ActivePoints, Memory

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
        ramp = _Ramp(*(memory[f"ramp_{name}"] for name in _Ramp._fields))
        result, switched = _fade(torque, active, ramp)
        if switched.any():
            rows = np.flatnonzero(switched)
            before = ramp.contacts[rows].astype(bool)
            ramp.torque[rows] += law(rows, before) - torque[rows]
            ramp.ticks[rows], ramp.contacts[rows] = self.ticks, active[rows]
            result[rows] = torque[rows] + ramp.torque[rows]
        return result


def through_contact_switches(
    ramp: ContactRamp | None,
    active: ActivePoints,
    torque: np.ndarray,
    law: Callable[[np.ndarray, ActivePoints], np.ndarray],
    memory: Memory,
) -> np.ndarray:
    """Return the torques of a law, led from one set of contacts to the next by a ramp if any.

    Args:
        ramp: None where the torque may jump.
        active: points in contact now.
        torque: (N, n) N·m of the law with them.
        law: returns the torques of some robots, given by their indices, with other contacts.
        memory: of the robots; updated.
    """
    if ramp is None or not active.switching:
        return torque
    return ramp.torque(
        torque, active.mask, lambda rows, mask: law(rows, ActivePoints(mask, True)), memory
    )


class _Ramp(NamedTuple):
    """What is remembered of N robots, to be updated.

    Attributes:
        contacts: (N, P) int64, which points were in contact a tick ago, or `_UNKNOWN`.
        ticks: (N,) int64, left of the ramp.
        torque: (N, n) N·m, what the ramp adds.
    """

    contacts: np.ndarray
    ticks: np.ndarray
    torque: np.ndarray


class _Faded(NamedTuple):
    torque: np.ndarray
    switched: np.ndarray


@kernel
def _fade(torque: np.ndarray, active: np.ndarray, ramp: _Ramp) -> _Faded:
    """Go on with the ramps by a tick, add them, and find where contacts have switched.

    Args:
        torque: (N, n) of the law.
        active: (N, P) bool, which points are in contact now.
        ramp: of the robots; updated. Unknown contacts become the present ones.
    """
    contacts, left, added = ramp
    switched, result = np.empty(len(torque), np.bool_), np.empty(torque.shape)
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
    return _Faded(result, switched)
