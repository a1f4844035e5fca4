"""What the model-based layers assume of contacts: the options that they share."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from fbid_gym.actions.contact_belief import ContactBelief, Schedule, contact_belief
from fbid_gym.actions.contact_ramp import ContactRamp
from fbid_gym.actions.passive_joints import PassiveJoints
from fbid_gym.control import ContactLimits
from fbid_gym.options import Choice, Number, check_fields
from fbid_gym.robots import Robot

CONTACT_LIMITS = ("friction", "none")

ContactLimit = Annotated[str, Choice(CONTACT_LIMITS)]
Friction = Annotated[float, Number(0.0, 10.0)]
Ramp = Annotated[float, Number(0.0, 10.0, "s")]


@dataclass(frozen=True)
class ContactOptions:
    """Options of every model-based layer, beside its own."""

    contacts: str | Schedule = "planned"
    """Which points are taken to be on the ground: "planned", the feet that stand in the reference;
    "all"; "measured"; or a schedule [(seconds, feet on the ground), ...]."""
    contact_limits: ContactLimit = "friction"
    """"friction" limits the contact forces; "none" is the papers' form."""
    contact_ramp: Ramp = 0.0
    """s that the torque takes from the old contacts' to the new ones' when they switch; at 0 it
    jumps, as in [M10] IV.D."""
    friction: Friction = 0.7
    """Coefficient assumed of every contact."""
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

    def belief(self, robot: Robot, control_hz: int) -> ContactBelief:
        """Return which points the layer takes to be in contact."""
        return contact_belief(self.contacts, robot, control_hz)

    def limits(self, robot: Robot) -> ContactLimits | None:
        """Return the limits of the contact forces; None for none."""
        least, most = self.min_normal_force, self.max_normal_force
        limits = ContactLimits(self.friction, least * robot.weight, most * robot.weight)
        return limits if self.contact_limits == "friction" else None

    def passive(self, robot: Robot) -> PassiveJoints:
        """Return what the joints take of their torques, as far as it is given back."""
        return PassiveJoints.of(
            robot, damping=self.compensate_damping, friction=self.compensate_friction
        )

    def ramp(self, control_hz: int) -> ContactRamp | None:
        """Return what smooths the switches; None if they are instantaneous."""
        ticks = round(self.contact_ramp * control_hz)
        return ContactRamp(ticks) if ticks > 0 else None


CONTACT_DEFAULTS = ContactOptions()

# Pendulum times. On points a ramp is behind its time: of 12 ms (go1) it brought the largest torque
# jumps from 0.26 to 0.14 of a limit, and the velocity error from 0.084 to 0.094 m/s.
_RAMP_ON_SOLES = 0.14


@dataclass(frozen=True)
class WalkingContact:
    """Options of the layers that walk with their feet; the gait says which feet are down."""

    contact_limits: ContactLimit = "friction"
    """As in `ContactOptions`."""
    contact_ramp: Ramp | None = None
    """s that the torque takes to what a touchdown or a lift-off makes of it. None: on soles 0.14 of
    the time in which the robot falls; on points it jumps, and what ramps is the load of a foot."""
    friction: Friction = 0.6
    """Coefficient assumed of every contact."""
    compensate_damping: bool = True
    """As in `ContactOptions`."""
    compensate_friction: bool = False
    """As in `ContactOptions`."""

    def __post_init__(self) -> None:
        """Check them."""
        check_fields(self)

    def options(self, robot: Robot, omega: float) -> ContactOptions:
        """Return what they mean for a robot that falls at a rate omega (1/s)."""
        ramp = _RAMP_ON_SOLES / omega if robot.has_soles else 0.0
        return ContactOptions(
            contact_limits=self.contact_limits,
            contact_ramp=ramp if self.contact_ramp is None else self.contact_ramp,
            friction=self.friction,
            compensate_damping=self.compensate_damping,
            compensate_friction=self.compensate_friction,
        )


WALKING_CONTACT_DEFAULTS = WalkingContact()
