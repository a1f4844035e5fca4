"""The reward: a table of weighted terms, each a small function of the measurements."""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from fbid_gym.options import Number


class Term(NamedTuple):
    """One term of a reward: its weight times its function.

    Attributes:
        function: takes what the task measured of N robots, see `Task.measure`, and the scale where
            there is one. Returns (N,) from 0, worst, to 1, best. It changes nothing.
        weight: greatest value of the term in the reward.
        scale: width of the term's bell, the error at which it has fallen to 1/e. None: it has none.
        unit: of the scale.
    """

    function: Callable[..., np.ndarray]
    weight: float
    scale: float | None = None
    unit: str = ""

    def share(self, measured: Any) -> np.ndarray:
        """Return the term's value before its weight, of N robots: (N,)."""
        if self.scale is None:
            return self.function(measured)
        return self.function(measured, self.scale)


Terms = Mapping[str, Term]
"""The table of a reward: name -> term. The reward is their sum."""

WEIGHT = Number(0.0, 1e6)
SCALE = Number(1e-6, 1e6)


def bell(error: np.ndarray, width: float) -> np.ndarray:
    """Return 1 where an error is zero, 1/e where it is as large as the width."""
    return np.exp(error * error * (-1.0 / width**2))


def level(cosine: np.ndarray, width: float) -> np.ndarray:
    """Return 1 where an angle is zero, 1/e where it is as large as the width (rad, pi at most)."""
    return np.exp((cosine - 1.0) / (1.0 - math.cos(min(width, math.pi))))


def upright(measured: Any, width: float) -> np.ndarray:
    """exp(-(1 - cos(tilt of the base)) / (1 - cos(scale)))."""
    return level(measured.outcome.posture.upright, width)


def torque(measured: Any, width: float) -> np.ndarray:
    """Bell of the torques' root mean square over the joints and the control ticks of the step."""
    return bell(measured.outcome.torque_rms, width * measured.units.torque)
