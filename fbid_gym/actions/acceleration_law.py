"""From a desired acceleration to joint torques: what the acceleration layers share."""

from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.contact_belief import ContactBelief, Schedule, contact_belief
from fbid_gym.actions.layer import Memory
from fbid_gym.actions.options import share
from fbid_gym.control import (
    ContactLimits,
    limited_inverse_dynamics,
    orthogonal_inverse_dynamics,
    symmetric_pseudo_inverse,
)
from fbid_gym.dynamics.contacts import ContactGeometry, reduced_contacts
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.support import Support
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.errors import InvalidValueError, UnknownOptionError
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot

CONTACT_LIMITS = ("friction", "none")

DIAGNOSTICS = ("residual", "underactuation")
"""Share of the weight by which the base wrench misses the commanded one; and the number of base
directions that the assumed contacts cannot push."""


@dataclass(frozen=True, eq=False)
class AccelerationLaw:
    """[M10] eq. (15) on a robot's feet, with or without limits on the contact forces.

    Attributes:
        robot: whose joints.
        geometry: of its contact points.
        belief: which points are taken to be in contact.
        limits: on their forces; None for the paper's form.
        base_priority: weight of base accelerations beside one for the joints, where the contacts do
            not allow both.
        damping: (n,) N·m·s/rad of the joints, to be compensated; zero for none.
        length: m, lever arm that makes moments on the base comparable to forces.
    """

    robot: Robot
    geometry: ContactGeometry
    belief: ContactBelief
    limits: ContactLimits | None
    base_priority: float
    damping: np.ndarray
    length: float

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        *,
        base_priority: float,
        contacts: str | Schedule,
        contact_limits: str,
        friction: float,
        min_normal_force: float,
        max_normal_force: float,
        compensate_damping: bool,
    ) -> "AccelerationLaw":
        """Check the options that the acceleration layers share; see there."""
        if contact_limits not in CONTACT_LIMITS:
            raise UnknownOptionError("contact_limits", contact_limits, CONTACT_LIMITS)
        if not isinstance(compensate_damping, bool):
            raise InvalidValueError("compensate_damping", compensate_damping, "True or False")
        share(min_normal_force=min_normal_force, max_normal_force=max_normal_force)
        limits = ContactLimits(
            friction, min_normal_force * robot.weight, max_normal_force * robot.weight
        )
        return cls(
            robot=robot,
            geometry=ContactGeometry.of(robot),
            belief=contact_belief(contacts, robot, control_hz),
            limits=limits if contact_limits == "friction" else None,
            base_priority=base_priority,
            damping=robot.joint_damping * compensate_damping,
            length=Support.of(robot).radius or 1.0,
        )

    def memory(self, num_robots: int) -> Memory:
        """Warm start of the contact forces, and the diagnostics."""
        return {
            "warm_start": np.zeros((num_robots, 6)),
            "residual": np.zeros(num_robots),
            "underactuation": np.zeros(num_robots),
        }

    def torque(
        self,
        acceleration: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: DynamicsTerms,
        memory: Memory,
    ) -> np.ndarray:
        """Return joint torques (N, n) N·m that come nearest to `acceleration` (N, nv)."""
        active = self.belief(state, reference)
        contacts = reduced_contacts(self.geometry, terms, active)
        arguments = (
            terms.mass_matrix,
            terms.bias,
            contacts.jacobian,
            acceleration,
            contacts.bias,
        )
        if self.limits is None:
            free = orthogonal_inverse_dynamics(*arguments, base_priority=self.base_priority)
            memory["underactuation"] = free.underactuation.astype(float)
            torque = free.torque
        else:
            limited = limited_inverse_dynamics(
                *arguments,
                self.limits,
                point_map=contacts.point_map,
                active=active,
                base_priority=self.base_priority,
                length=self.length,
                warm_start=memory["warm_start"],
            )
            memory["warm_start"], memory["residual"] = limited.warm_start, limited.residual
            if active is not None:
                base = contacts.jacobian[:, :, :6]
                _, rank = symmetric_pseudo_inverse(base.swapaxes(1, 2) @ base, 1e-6)
                memory["underactuation"] = 6.0 - rank
            torque = limited.torque
        return torque + self.damping * state.qvel[:, 6:]
