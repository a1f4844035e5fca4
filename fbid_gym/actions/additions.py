"""Entries added to a layer's action: offsets of footholds, step rate, joint torques."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import InvalidValueError
from fbid_gym.motions.gait.command import Steering
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import Number, checked
from fbid_gym.robots import Robot

_MOST_SHIFT = 0.2  # of the height of the centre of mass
_MOST_RATE = 0.2  # share by which the frequency of the gait can be raised, or lowered


@dataclass(frozen=True, eq=False)
class Additions:
    """The part of an action that comes after the action layer's.

    Attributes:
        action_names: two entries a foot, one for the frequency of the gait, one a joint, or less.
        feet: (F,) m by which action 1 moves the next foothold of each foot; zeros for none.
        step_rate: share by which action 1 raises the frequency; 0 for none.
        torque: (n,) N·m that action 1 adds to that of each joint; zeros for none.
    """

    action_names: tuple[str, ...]
    feet: np.ndarray
    step_rate: float
    torque: np.ndarray

    @classmethod
    @checked
    def of(
        cls,
        robot: Robot,
        kind: MotionKind,
        *,
        footholds: bool | None = None,
        step_rate: bool = False,
        residual_torque: Annotated[float, Number(0.0, 1.0)] = 0.0,
    ) -> "Additions":
        """Return what is added to the action of a layer.

        Args:
            robot: whose feet.
            kind: of motion; what is planned beforehand cannot be steered.
            footholds: whether the action moves the next foothold of each foot, by up to a fifth of
                the height of the centre of mass. Default: on a gait
                those of the layers `base_acceleration` and `com_wrench` do.
            step_rate: whether the action changes the gait's frequency.
            residual_torque: share of its torque limit that the action adds to the torque of each
                joint, by one more entry a joint; 0 for none.

        Raises:
            InvalidValueError: there is no gait to steer.
        """
        if not kind.gait and (footholds or step_rate):
            name = "footholds" if footholds else "step_rate"
            raise InvalidValueError(name, True, "False where no gait makes the steps")
        scale = _MOST_SHIFT * float(Stance.of(robot).home_com[2]) * bool(footholds)
        torque, names = residual_torque * robot.torque_limit, []
        for foot in robot.foot_names if footholds else ():
            for way in ("ahead", "to the left"):
                names.append(f"next foothold of {foot}, {way} (x {scale:.3g} m)")
        if step_rate:
            names.append(f"frequency of the gait (x {100 * _MOST_RATE:g} %)")
        if residual_torque:
            joints = zip(robot.joint_names, torque, strict=True)
            names += [f"torque of {joint} (x {size:.3g} N·m)" for joint, size in joints]
        return cls(tuple(names), np.full(robot.num_feet, scale), _MOST_RATE * step_rate, torque)

    def split(self, action: np.ndarray) -> tuple[Steering, np.ndarray | None]:
        """Return what actions (N, S) in [-1, 1] say to the gait, and N·m (N, n) to add, or None."""
        count, moved = len(action), 2 * len(self.feet) * self.feet.any()
        shift = np.zeros((count, len(self.feet), 2))
        if moved:
            shift[:] = self.feet[:, None] * action[:, :moved].reshape(shift.shape)
        rate = np.ones(count) + (self.step_rate * action[:, moved] if self.step_rate else 0.0)
        torque = self.torque * action[:, -len(self.torque) :] if self.torque.any() else None
        return Steering(shift, rate), torque
