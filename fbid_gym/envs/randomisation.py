"""How robots may differ from their MJCF, and the controller's model from both."""

from dataclasses import dataclass, fields
from typing import Any

from fbid_gym.checks import number, pair
from fbid_gym.errors import InvalidValueError, UnknownOptionError


@dataclass(frozen=True)
class Randomisation:
    """Ranges of the random differences, drawn anew for each robot and episode; all off by default.

    The plant is the simulated robot; the model is what model-based layers compute with. The model
    starts from the robot's MJCF and does not see how the plant differs.
    """

    mass: float = 0.0
    """Plant: each body's mass and inertia are scaled by 1 ± up to this share."""
    com: float = 0.0
    """Plant: each body's centre of mass is moved by up to this (m) along each axis."""
    friction: tuple[float, float] = (1.0, 1.0)
    """Plant: (least, most) factor on the friction of the contacts."""
    model_mass: float = 0.0
    """Model: each body's mass and inertia are scaled by 1 ± up to this share."""
    model_com: float = 0.0
    """Model: each body's centre of mass is moved by up to this (m) along each axis."""

    @classmethod
    def of(cls, arguments: dict[str, Any]) -> "Randomisation":
        """Build from keyword arguments, naming any that does not exist."""
        names = [field.name for field in fields(cls)]
        for name in arguments:
            if name not in names:
                raise UnknownOptionError("randomisation", name, names)
        return cls(**arguments)

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name, most in (("mass", 1.0), ("model_mass", 1.0), ("com", None), ("model_com", None)):
            full, expected = f"randomisation {name}", "[0, 1)" if most else "a length >= 0 m"
            value = number(full, getattr(self, name), expected)
            if value < 0.0 or (most and value >= most):
                raise InvalidValueError(full, value, expected)
        friction = pair("randomisation friction", self.friction)
        if not 0.0 < friction[0] <= friction[1]:
            raise InvalidValueError("randomisation friction", friction, "a pair 0 < least <= most")
        object.__setattr__(self, "friction", friction)

    @property
    def any(self) -> bool:
        """Whether anything is random."""
        return self != Randomisation()
