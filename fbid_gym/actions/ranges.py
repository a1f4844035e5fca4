"""What the numbers among the options of the layers may be: more than any robot needs."""

from dataclasses import dataclass
from typing import Annotated, Any

from fbid_gym.actions.falling import Falling
from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Number

MOST_HERTZ = 1000.0


@dataclass(frozen=True)
class Hertz:
    """A frequency: a number of Hz, or `Falling`; or one of a few words."""

    least: float = 1e-3
    also: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """See `fbid_gym.options.Kind`."""
        return " or ".join([self._number.words, *(f'"{word}"' for word in self.also)])

    def check(self, name: str, value: Any) -> Any:
        """See `fbid_gym.options.Kind`."""
        if isinstance(value, str) and value in self.also:
            return value
        number = value.times if isinstance(value, Falling) else value
        if not self._number.holds(number):
            raise InvalidValueError(name, value, self.words)
        return Falling(float(number)) if isinstance(value, Falling) else float(number)

    @property
    def _number(self) -> Number:
        return Number(self.least, MOST_HERTZ, "Hz")


Frequency = Annotated[float | Falling, Hertz()]
DampingRatio = Annotated[float, Number(0.01, 100.0)]
TargetScale = Annotated[float, Number(1e-6, 100.0, "rad")]
AccelerationScale = Annotated[float, Number(1e-6, 1e5, "rad/s^2")]
Priority = Annotated[float, Number(1e-6, 1e9)]
