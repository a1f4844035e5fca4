"""What the model-based layers assume of contacts: the options that they share."""

from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.contact_belief import ContactBelief, Schedule, contact_belief
from fbid_gym.actions.contact_ramp import ContactRamp
from fbid_gym.checks import check_at_least_zero, check_share
from fbid_gym.control import ContactLimits
from fbid_gym.errors import InvalidValueError, UnknownOptionError
from fbid_gym.robots import Robot

CONTACT_LIMITS = ("friction", "none")


@dataclass(frozen=True)
class ContactOptions:
    """Options of every model-based layer, beside its own."""

    contacts: str | Schedule = "planned"
    """Which points are taken to be on the ground: "planned", the feet that stand in the reference;
    "all"; "measured"; or a schedule [(seconds, feet on the ground), ...]."""
    contact_limits: str = "friction"
    """"friction" limits the contact forces; "none" is the papers' form."""
    contact_ramp: float = 0.0
    """s that the torque takes from the old contacts' to the new ones' when they switch; at 0 it
    jumps, as in [M10] IV.D."""
    friction: float = 0.7
    """Coefficient assumed of every contact."""
    min_normal_force: float = 0.0
    """Least normal force of a point in contact, share of the weight."""
    max_normal_force: float = np.inf
    """Greatest, share of the weight."""
    compensate_damping: bool = True
    """Add the torque that the joints' viscous damping takes away."""

    def belief(self, robot: Robot, control_hz: int) -> ContactBelief:
        """Return which points the layer takes to be in contact."""
        return contact_belief(self.contacts, robot, control_hz)

    def limits(self, robot: Robot) -> ContactLimits | None:
        """Return the limits of the contact forces; None for none."""
        if self.contact_limits not in CONTACT_LIMITS:
            raise UnknownOptionError("contact_limits", self.contact_limits, CONTACT_LIMITS)
        least, most = self.min_normal_force, self.max_normal_force
        check_share(min_normal_force=least, max_normal_force=most)
        limits = ContactLimits(self.friction, least * robot.weight, most * robot.weight)
        return limits if self.contact_limits == "friction" else None

    def damping(self, robot: Robot) -> np.ndarray:
        """Return the joint damping to compensate: (n,) N·m·s/rad, zero for none."""
        if not isinstance(self.compensate_damping, bool):
            raise InvalidValueError("compensate_damping", self.compensate_damping, "True or False")
        return robot.joint_damping * self.compensate_damping

    def ramp(self, control_hz: int) -> ContactRamp | None:
        """Return what smooths the switches; None if they are instantaneous."""
        check_at_least_zero(contact_ramp=self.contact_ramp)
        ticks = round(self.contact_ramp * control_hz)
        return ContactRamp(ticks) if ticks > 0 else None


CONTACT_DEFAULTS = ContactOptions()
