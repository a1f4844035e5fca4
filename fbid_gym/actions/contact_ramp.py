"""Contact switches without a jump in the torque."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.quantities import Memory

_UNKNOWN = -1


@dataclass(frozen=True)
class ContactRamp:
    """Leads the torque of a layer from one set of contacts to the next.

    When contacts switch, the law's torque jumps by some d from the last tick to this. The ramp adds
    -d, and takes it away again linearly in time. So the torque goes on from where it was, feedback
    acts through the new contacts at once, and the load of a foot fades in or out. A switch during a
    ramp adds its own difference to what is left.
    """

    ticks: int  # control ticks of a ramp

    def memory(self, num_robots: int, num_points: int, num_joints: int) -> Memory:
        """Return what is remembered of robots that have not moved yet."""
        return {
            "ramp_contacts": np.full((num_robots, num_points), _UNKNOWN, np.int64),
            "ramp_ticks": np.zeros(num_robots, np.int64),
            "ramp_torque": np.zeros((num_robots, num_joints)),
            "ramp_law": np.zeros((num_robots, num_joints)),
        }

    def torque(self, torque: np.ndarray, active: np.ndarray, memory: Memory) -> np.ndarray:
        """Return the torques (N, n) to apply.

        Args:
            torque: (N, n) of the law with the contacts `active`.
            active: (N, P) bool, which points are in contact now.
            memory: of the robots; updated.
        """
        return _fade(
            torque, active, self.ticks, _Ramp(*(memory[f"ramp_{name}"] for name in _Ramp._fields))
        )


class _Ramp(NamedTuple):
    """What is remembered of N robots, to be updated."""

    contacts: np.ndarray  # (N, P) int64, which points were in contact a tick ago, or `_UNKNOWN`
    ticks: np.ndarray  # (N,) int64, left of the ramp
    torque: np.ndarray  # (N, n) N·m, what the ramp adds
    law: np.ndarray  # (N, n) N·m, of the law a tick ago


@kernel
def _fade(torque: np.ndarray, active: np.ndarray, ticks: int, ramp: _Ramp) -> np.ndarray:
    """Go on with the ramps by a tick, begin others where contacts have switched, and add them.

    See `ContactRamp.torque`. Unknown contacts become the present ones.
    """
    contacts, left, added, before = ramp
    result = np.empty(torque.shape)
    for i in range(len(torque)):
        unknown, switched = contacts[i, 0] == _UNKNOWN, False
        for j in range(active.shape[1]):
            switched |= contacts[i, j] != active[i, j]
            contacts[i, j] = active[i, j]
        share = 0.0
        if left[i] > 0:
            left[i] -= 1
            share = left[i] / (left[i] + 1.0)
        for j in range(torque.shape[1]):
            added[i, j] *= share
            if switched and not unknown:
                added[i, j] += before[i, j] - torque[i, j]
            before[i, j] = torque[i, j]
            result[i, j] = torque[i, j] + added[i, j]
        if switched and not unknown:
            left[i] = ticks
    return result
