"""What the model-based layers assume of contacts: the options that they share."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from fbid_gym.actions.contact_belief import Schedule
from fbid_gym.actions.contact_ramp import ContactRamp
from fbid_gym.control.contact_forces import ContactLimits
from fbid_gym.dynamics.passive_joints import PassiveJoints
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import Choice, Number, check_fields
from fbid_gym.robots import Robot
from fbid_gym.robots.home_check import ASSUMED_FRICTION, friction_of_feet

CONTACT_LIMITS = ("friction", "none")

ContactLimit = Annotated[str, Choice(CONTACT_LIMITS)]
Friction = Annotated[float, Number(0.0, 10.0)]
Ramp = Annotated[float, Number(0.0, 10.0, "s")]

_RAMP_ON_SOLES = 0.14  # pendulum times
_CAREFUL = 0.9


@dataclass(frozen=True)
class ContactOptions:
    """Options of every model-based layer, beside its own. None: what robot and task suggest."""

    contacts: str | Schedule = "planned"
    """Which points are taken to be on the ground: "planned", those of the feet that shall stand;
    "all"; "measured"; or a schedule [(seconds, feet on the ground), ...]."""
    contact_limits: ContactLimit = "friction"
    """"friction" limits the contact forces; "none" is the papers' form."""
    contact_ramp: Ramp | None = None
    """s that the torque takes to what a switch of contacts makes of it; at 0 it jumps, as in [M10]
    IV.D. None: 0, but for gaits on soles 0.14 of the time in which the robot falls."""
    friction: Friction | None = None
    """Coefficient assumed of every contact. None: 0.6, or nine tenths of what the model's feet have
    on its ground, if that is less."""
    notice_slip: bool = True
    """Count on less friction while feet that stand slip, see `fbid_gym.control.grip`."""
    min_normal_force: Annotated[float, Number(0.0, 100.0)] = 0.0
    """Least normal force of a point in contact, share of the weight."""
    max_normal_force: Annotated[float, Number(0.0, np.inf)] = np.inf
    """Greatest, share of the weight."""
    compensate_damping: bool = True
    """Add the torque that the joints' viscous damping takes away. What springs take always is."""
    compensate_friction: bool = False
    """Add the torque that the joints' dry friction takes away while they move."""

    def __post_init__(self) -> None:
        """Check them."""
        check_fields(self)

    def on(self, robot: Robot, kind: MotionKind) -> "ContactOptions":
        """Return what they mean for a robot and a kind of motion: None is filled in."""
        # On points a ramp is behind its time: of 12 ms (go1) it brought the largest torque jumps
        # from 0.26 to 0.14 of a limit, and the velocity error from 0.084 to 0.094 m/s.
        ramp = _RAMP_ON_SOLES / kind.omega if kind.gait and robot.has_soles else 0.0
        least = friction_of_feet(robot.at_home, robot.feet)
        return replace(
            self,
            contact_ramp=ramp if self.contact_ramp is None else self.contact_ramp,
            friction=min(ASSUMED_FRICTION, _CAREFUL * least)
            if self.friction is None
            else self.friction,
        )

    @property
    def coefficient(self) -> float:
        """Of friction, once it has been filled in."""
        return ASSUMED_FRICTION if self.friction is None else self.friction

    def limits(self, robot: Robot) -> ContactLimits | None:
        """Return the limits of the contact forces; None for none."""
        least, most = self.min_normal_force, self.max_normal_force
        limits = ContactLimits(self.coefficient, least * robot.weight, most * robot.weight)
        return limits if self.contact_limits == "friction" else None

    def passive(self, robot: Robot) -> PassiveJoints:
        """Return what the joints take of their torques, as far as it is given back."""
        return PassiveJoints.of(
            robot, damping=self.compensate_damping, friction=self.compensate_friction
        )

    def ramp(self, control_hz: int) -> ContactRamp | None:
        """Return what smooths the switches; None if they are instantaneous."""
        ticks = round((self.contact_ramp or 0.0) * control_hz)
        return ContactRamp(ticks) if ticks > 0 else None


CONTACT_DEFAULTS = ContactOptions()
