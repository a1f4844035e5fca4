"""Ranges of the numbers among the options of the layers: wider than any robot needs.

Frequencies serve any robot in units of the one at which it falls over.
"""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Number
from fbid_gym.robots import Robot


class Falling(NamedTuple):
    """A frequency, `times` that of the robot as a pendulum, sqrt(g / height) / (2 pi).

    The height is that of the centre of mass at home: 0.59 Hz for the biped, 0.96 Hz for go1.
    """

    times: float


def in_hertz(robot: Robot, frequency: Any) -> Any:
    """Return a frequency that is `Falling` in Hz, and anything else as it is."""
    if isinstance(frequency, Falling):
        return frequency.times * Stance.of(robot).falling_rate / (2.0 * np.pi)
    return frequency


MOST_HERTZ = 1000.0
_GAIN = Number(0.0, 1e9)


@dataclass(frozen=True)
class Hertz:
    """A frequency: a number of Hz, or `Falling`; or one of a few words, or a pair of gains."""

    least: float = 1e-3
    also: tuple[str, ...] = ()
    gains: bool = False

    @property
    def words(self) -> str:
        """See `fbid_gym.options.Kind`."""
        words = [self._number.words, *(f'"{word}"' for word in self.also)]
        return " or ".join([*words, *(["a pair of gains, 1/s^2 and 1/s"] if self.gains else [])])

    def check(self, name: str, value: Any) -> Any:
        """See `fbid_gym.options.Kind`."""
        if isinstance(value, str) and value in self.also:
            return value
        if self.gains and isinstance(value, list | tuple) and len(value) == 2:
            return tuple(_GAIN.check(name, gain) for gain in value)
        number = value.times if isinstance(value, Falling) else value
        if not self._number.holds(number):
            raise InvalidValueError(name, value, self.words)
        return Falling(float(number)) if isinstance(value, Falling) else float(number)

    @property
    def _number(self) -> Number:
        return Number(self.least, MOST_HERTZ, "Hz")


@dataclass(frozen=True)
class Weight(Number):
    """A number; or two, of the moment that tilts the body and of that which turns it."""

    @property
    def words(self) -> str:
        """See `fbid_gym.options.Kind`."""
        return f"{super().words}, or two: of the moment that tilts, and of that which turns"

    def check(self, name: str, value: Any) -> Any:
        """See `fbid_gym.options.Kind`."""
        if isinstance(value, list | tuple) and len(value) == 2:
            return tuple(super(Weight, self).check(name, one) for one in value)
        return super().check(name, value)


Frequency = Annotated[float | Falling, Hertz()]
Response = Annotated[float | Falling | tuple[float, float], Hertz(gains=True)]
"""A frequency, or stiffness and damping."""
DampingRatio = Annotated[float, Number(0.01, 100.0)]
TargetScale = Annotated[float, Number(1e-6, 100.0, "rad")]
AccelerationScale = Annotated[float, Number(1e-6, 1e5, "rad/s^2")]
LoopDelay = Annotated[float, Number(0.0, 0.03, "s")]
"""From a state to its torque: of gains on joints more would leave next to nothing."""
Priority = Annotated[float | tuple[float, float], Weight(1e-6, 1e9)]
