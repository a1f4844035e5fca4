"""How often physics, the action layer and the policy run."""

from dataclasses import dataclass

from fbid_gym.checks import whole_number
from fbid_gym.errors import InvalidValueError


@dataclass(frozen=True)
class Rates:
    """Rates in Hz; each divides the one before it.

    Attributes:
        physics: simulation steps per second.
        control: action-layer ticks per second.
        policy: environment steps per second.
    """

    physics: int = 1000
    control: int = 500
    policy: int = 50

    def __post_init__(self) -> None:
        """Check that every rate is a positive integer that divides the next faster one."""
        for name in ("physics", "control", "policy"):
            object.__setattr__(self, name, whole_number(f"{name}_hz", getattr(self, name)))
        for fast, slow in (("physics", "control"), ("control", "policy")):
            ratio = getattr(self, fast) / getattr(self, slow)
            if ratio != int(ratio):
                raise InvalidValueError(
                    f"{slow}_hz",
                    getattr(self, slow),
                    f"a divisor of {fast}_hz = {getattr(self, fast)} "
                    f"(it is {ratio:g} times slower)",
                )

    @property
    def substeps(self) -> int:
        """Physics steps per control tick."""
        return self.physics // self.control

    @property
    def ticks(self) -> int:
        """Control ticks per policy step."""
        return self.control // self.policy
