"""What joints lose to viscous damping, given back."""

import numpy as np

from fbid_gym.compiled import compiled


@compiled
def overcome_damping(damping: np.ndarray, torque: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Add to torques (N, n), in place, what the joints' damping takes at velocities (N, nv).

    Args:
        damping: (n,) N·m·s/rad; zero where it is left to the robot.
        torque: changed and returned.
        velocity: of the robots.
    """
    for i in range(len(torque)):
        for j in range(torque.shape[1]):
            torque[i, j] += damping[j] * velocity[i, 6 + j]
    return torque
