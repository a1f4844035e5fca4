"""The result of a policy step."""

from typing import NamedTuple

import numpy as np

TERMINATIONS = ("", "fall", "diverged")
"""How an episode ended; its place here is `termination` in the info."""


class Step(NamedTuple):
    """The result of one policy step for N environments."""

    observation: np.ndarray  # (N, O) float32
    reward: np.ndarray  # (N,)
    terminated: np.ndarray  # (N,) bool
    truncated: np.ndarray  # (N,) bool
    info: dict[str, np.ndarray]  # name -> (N, ...) arrays
