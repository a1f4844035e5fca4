"""The part of an action that steers a gait: where the next feet land, and how often."""

from dataclasses import dataclass

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.gait.command import Steering
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import checked
from fbid_gym.robots import Robot

_MOST_SHIFT = 0.2  # of the height of the centre of mass
_MOST_RATE = 0.2  # share by which the frequency of the gait can be raised, or lowered


@dataclass(frozen=True)
class Footholds:
    """What of an action steers; it comes after that of the action layer.

    Attributes:
        feet: names of those that the action moves the footholds of; none for none.
        num_feet: F, of the robot.
        scale: m at action 1.
        step_rate: whether one more entry raises the frequency of the gait, by a fifth at action 1.
    """

    feet: tuple[str, ...]
    num_feet: int
    scale: float
    step_rate: bool

    @classmethod
    @checked
    def of(
        cls,
        robot: Robot,
        kind: MotionKind,
        *,
        footholds: bool | None = None,
        step_rate: bool = False,
    ) -> "Footholds":
        """Return what steers the gait of a robot.

        Args:
            robot: whose feet.
            kind: of motion; what is planned beforehand cannot be steered.
            footholds: whether the action moves the next foothold of each foot, by up to a fifth of
                the height of the centre of mass. Default: on a gait
                those of the layers `base_acceleration` and `com_wrench` do.
            step_rate: whether the action changes the gait's frequency.

        Raises:
            InvalidValueError: there is no gait to steer.
        """
        if not kind.gait and (footholds or step_rate):
            name = "footholds" if footholds else "step_rate"
            raise InvalidValueError(name, True, "False where no gait makes the steps")
        scale = _MOST_SHIFT * float(Stance.of(robot).home_com[2])
        return cls(robot.foot_names if footholds else (), robot.num_feet, scale, step_rate)

    @property
    def action_names(self) -> tuple[str, ...]:
        """Two entries a foot, and one for the frequency."""
        names = [
            f"next foothold of {foot}, {way} (x {self.scale:.3g} m)"
            for foot in self.feet
            for way in ("ahead", "to the left")
        ]
        if self.step_rate:
            names.append(f"frequency of the gait (x {100 * _MOST_RATE:g} %)")
        return tuple(names)

    def steering(self, action: np.ndarray) -> Steering:
        """Return what an action (N, S) in [-1, 1] says, S the number of `action_names`."""
        count, moved = len(action), 2 * len(self.feet)
        shift, rate = np.zeros((count, self.num_feet, 2)), np.ones(count)
        if moved:
            shift[:] = self.scale * action[:, :moved].reshape(count, self.num_feet, 2)
        if self.step_rate:
            rate += _MOST_RATE * action[:, moved]
        return Steering(shift, rate)
