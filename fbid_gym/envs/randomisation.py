"""How robots may differ from their MJCF, and the controller's model from both."""

from dataclasses import dataclass, fields
from typing import Any

from fbid_gym.checks import number, pair
from fbid_gym.errors import InvalidValueError, UnknownOptionError

LONGEST_DELAY = 1.0
"""s; every action on its way is remembered."""

_FACTORS = ("friction", "motor_strength", "total_mass", "model_total_mass", "model_inertia")


@dataclass(frozen=True)
class Randomisation:
    """Ranges of the random differences, drawn anew for each robot and episode; all off by default.

    The plant is the simulated robot; the model is what model-based layers compute with. The model
    starts from the robot's MJCF and does not see how the plant differs. Nor does anybody see how
    strong the motors are: torques that are observed, rewarded and reported are those commanded.
    """

    mass: float = 0.0
    """Plant: each body's mass and inertia are scaled by 1 ± up to this share."""
    com: float = 0.0
    """Plant: each body's centre of mass is moved by up to this (m) along each axis."""
    friction: tuple[float, float] = (1.0, 1.0)
    """Plant: (least, most) factor on the friction of the contacts."""
    motor_strength: tuple[float, float] = (1.0, 1.0)
    """Plant: (least, most) factor on the torque of each joint's motor."""
    action_delay: tuple[float, float] = (0.0, 0.0)
    """Plant: (least, most) s from the choice of an action to its arrival at the action layer, in
    whole control ticks. Until the first one arrives there is the zero action."""
    model_mass: float = 0.0
    """Model: each body's mass and inertia are scaled by 1 ± up to this share."""
    model_com: float = 0.0
    """Model: each body's centre of mass is moved by up to this (m) along each axis."""
    total_mass: tuple[float, float] = (1.0, 1.0)
    """Plant: (least, most) factor on the masses and inertias of all bodies alike."""
    model_total_mass: tuple[float, float] = (1.0, 1.0)
    """Model: (least, most) factor on the masses and inertias of all bodies alike."""
    model_inertia: tuple[float, float] = (1.0, 1.0)
    """Model: (least, most) factor on the rotational inertias of all bodies alike."""
    model_com_ahead: tuple[float, float] = (0.0, 0.0)
    """Model: (least, most) m by which the base's centre of mass lies farther ahead."""

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
        for name in _FACTORS:
            factor = pair(f"randomisation {name}", getattr(self, name))
            if not 0.0 < factor[0] <= factor[1]:
                raise InvalidValueError(f"randomisation {name}", factor, "a pair 0 < least <= most")
            object.__setattr__(self, name, factor)
        delay = pair("randomisation action_delay", self.action_delay)
        if not 0.0 <= delay[0] <= delay[1] <= LONGEST_DELAY:
            expected = f"a pair 0 <= least <= most <= {LONGEST_DELAY:g} of s"
            raise InvalidValueError("randomisation action_delay", delay, expected)
        object.__setattr__(self, "action_delay", delay)
        ahead = pair("randomisation model_com_ahead", self.model_com_ahead)
        if not ahead[0] <= ahead[1]:
            raise InvalidValueError("randomisation model_com_ahead", ahead, "a pair least <= most")
        object.__setattr__(self, "model_com_ahead", ahead)

    @property
    def any(self) -> bool:
        """Whether anything is random."""
        return self != Randomisation()
