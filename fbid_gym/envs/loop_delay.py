"""Torques on their way from the action layer to the motors: the delay of the inner loop.

From a sensor's reading to the torque that answers it pass time for measuring, sending, computing
and sending. For what happens in the loop it is the same where in it the time passes, so the torque
waits here, and layers see the present. A policy's actions wait elsewhere, and longer
(`fbid_gym.runtime.action_delay`).

A delay need not be a whole number of control ticks. Where a torque arrives in the middle of one,
the mean of the old and the new one acts during the tick: the same impulse.

What the motors' drives make of their own joints does not wait: they measure and act on the spot.
"""

import numpy as np


class LoopDelay:
    """Torques on their way to the motors of N robots."""

    def __init__(self, num_robots: int, num_joints: int, control_hz: int, longest: float) -> None:
        """Begin without delay; robots may get one of at most `longest` s."""
        self.control_hz = control_hz  # control ticks per second
        size = 1 + int(np.ceil(round(longest * control_hz, 6)))
        # All that changes, by name: the last torques sent, N·m, newest first; and the delays in
        # control ticks.
        self.arrays = {
            "torque": np.zeros((num_robots, size, num_joints)),
            "ticks": np.zeros(num_robots),
        }

    @property
    def most_ticks(self) -> int:
        """Control ticks that a torque may wait."""
        return self.arrays["torque"].shape[1] - 1

    def begin(self, ids: np.ndarray, seconds: np.ndarray) -> None:
        """Begin episodes of robots (K,) with delays (K,) s."""
        self.arrays["ticks"][ids] = np.round(seconds * self.control_hz, 6)

    def arriving(
        self, torque: np.ndarray, tick: np.ndarray, own: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Return the torques (N, n) N·m that act now, where such torques have just been made.

        Before the first one arrives it acts at once: the robots stood there, held by it, before.
        Their episodes began `tick` (N,) control ticks ago. The drives make their `own` part (N, n)
        of these torques themselves: that part acts now.
        """
        waiting, ticks = self.arrays["torque"], self.arrays["ticks"]
        waiting[:, 1:] = waiting[:, :-1]
        waiting[:, 0] = torque - own
        begun = tick == 0
        waiting[begun] = waiting[begun, :1]
        whole = ticks.astype(np.int64)
        rest, robots = (ticks - whole)[:, None], np.arange(len(ticks))
        older = np.minimum(whole + 1, self.most_ticks)
        arrived = (1.0 - rest) * waiting[robots, whole] + rest * waiting[robots, older]
        acting: np.ndarray = arrived + own
        return acting
