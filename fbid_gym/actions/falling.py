"""Frequencies for any robot: in units of the one at which it falls over."""

from typing import Any, NamedTuple

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.robots import Robot


class Falling(NamedTuple):
    """A frequency, `times` that of the robot as a pendulum, sqrt(g / height) / (2 pi).

    The height is that of the centre of mass at home: 0.59 Hz for the biped, 0.96 Hz for go1.
    """

    times: float


def in_hertz(robot: Robot, **frequencies: Any) -> dict[str, Any]:
    """Return frequencies by name, those that are `Falling` in Hz and others as they are."""
    return {
        name: value.times * Stance.of(robot).falling_rate / (2.0 * np.pi)
        if isinstance(value, Falling)
        else value
        for name, value in frequencies.items()
    }
