"""Rates of the physics, of the action layer and of the policy."""

from dataclasses import dataclass
from typing import Annotated

from fbid_gym.errors import InvalidValueError
from fbid_gym.options import Whole, check_fields

Rate = Annotated[int, Whole(1, 100_000, "Hz")]


@dataclass(frozen=True)
class Rates:
    """Rates in Hz; each divides the one before it."""

    physics: Rate = 1000  # simulation steps per second
    control: Rate = 500  # action-layer ticks per second
    policy: Rate = 50  # environment steps per second

    def __post_init__(self) -> None:
        """Check that every rate is a whole number that divides the next faster one."""
        check_fields(self, "{}_hz")
        for fast, slow in (("physics", "control"), ("control", "policy")):
            whole, part = getattr(self, fast), getattr(self, slow)
            if whole % part:
                times = f"(it is {whole / part:g} times slower)"
                raise InvalidValueError(
                    f"{slow}_hz", part, f"a divisor of {fast}_hz = {whole} {times}"
                )

    @property
    def substeps(self) -> int:
        """Physics steps per control tick."""
        return self.physics // self.control

    @property
    def ticks(self) -> int:
        """Control ticks per policy step."""
        return self.control // self.policy
