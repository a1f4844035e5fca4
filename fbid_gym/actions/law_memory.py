"""What the laws of the model-based layers remember from tick to tick."""

from typing import NamedTuple

import numpy as np

from fbid_gym.actions.contact_ramp import ContactRamp
from fbid_gym.compiled import compiled
from fbid_gym.quantities import Memory
from fbid_gym.small_matrices import copy

DIAGNOSTICS = ("residual", "underactuation")
"""Share of the weight by which the base wrench misses the commanded one; and the number of base
directions that the assumed contacts cannot push."""


class LawMemory(NamedTuple):
    """What a law remembers of N robots; updated by it.

    Attributes:
        warm_start: (N, 6) of the contact forces.
        residual: (N,) share of the weight by which the wrench misses the desired one.
        underactuation: (N,) directions of the base that the contacts cannot push.
    """

    warm_start: np.ndarray
    residual: np.ndarray
    underactuation: np.ndarray

    @classmethod
    def of(cls, memory: Memory) -> "LawMemory":
        """Return the law's part of a layer's memory, to be updated in place."""
        return cls(memory["warm_start"], memory["residual"], memory["underactuation"])


def fresh_memory(
    num_robots: int, ramp: ContactRamp | None, num_contacts: int, num_joints: int
) -> Memory:
    """Return a law's memory, and its ramp's if any, of robots that have not moved yet."""
    own = LawMemory(np.zeros((num_robots, 6)), np.zeros(num_robots), np.zeros(num_robots))
    if ramp is None:
        return own._asdict()
    return own._asdict() | ramp.memory(num_robots, num_contacts, num_joints)


def diagnostics_of(limited: bool) -> tuple[str, ...]:
    """What of its memory a law of accelerations reports.

    Where contact forces have no limits they miss no wrench but that of directions in which the
    contacts cannot push at all.
    """
    return DIAGNOSTICS if limited else DIAGNOSTICS[1:]


@compiled
def remember(warm_start: np.ndarray, residual: np.ndarray, memory: LawMemory) -> None:
    """Write the warm start (N, 6) of the next tick and the residual (N,) of this one."""
    copy(residual, memory.residual)
    for i in range(len(warm_start)):
        copy(warm_start[i], memory.warm_start[i])
