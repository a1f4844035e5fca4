"""Modes of a foot: it stands, swings, or reaches for ground that is lower than planned.

The schedule says when a foot lifts. When it stands again the ground decides: a foot that meets it
late in its swing stands from then on, whatever was planned, and one that has come to the end of its
swing without meeting it reaches on down until it does, or until it is due to lift again.
"""

import numpy as np

from fbid_gym.compiled import compiled

STANCE, SWING, REACH = 0, 1, 2
"""Modes of a foot."""

# Shares of a swing: a foot that is still on the ground has not left it yet, one that is not ready
# to lift within the first part waits for its next turn, and one that meets the ground lands.
_LEAVE = 0.2
_LAND = 0.5


@compiled
def next_mode(mode: int, touches: bool, lifts: bool, share: float) -> int:
    """Return the next mode of a foot.

    Args:
        mode: its present mode.
        touches: whether it carries weight.
        lifts: whether it may leave the ground.
        share: of the planned swing that has passed; 1 or more in the planned stance.
    """
    if mode != SWING and lifts and share < _LEAVE:
        return SWING
    if mode == STANCE:
        return STANCE
    if mode == SWING and share < 1.0:
        return STANCE if touches and share > _LAND else SWING
    return STANCE if touches else REACH


@compiled
def load_on(foot: int, foot_of_point: np.ndarray, contact_force: np.ndarray) -> float:
    """Return the load of a foot, N, from the forces (P, 3) on the contact points."""
    load = 0.0
    for point in range(len(foot_of_point)):
        if foot_of_point[point] == foot:
            load += contact_force[point, 2]
    return load
