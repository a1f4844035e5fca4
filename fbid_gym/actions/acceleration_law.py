"""From a desired acceleration to joint torques: what the acceleration layers share."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.contact_belief import ContactBelief
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.contact_ramp import ContactRamp, through_contact_switches
from fbid_gym.actions.law_memory import LawMemory, diagnostics_of, fresh_memory, remember
from fbid_gym.actions.passive_joints import PassiveJoints, give_back
from fbid_gym.compiled import bind, compiled, kernel
from fbid_gym.control import ContactLimits
from fbid_gym.control.contact_forces import DEFAULT_ACCURACY, limit_rows, wrench_scale
from fbid_gym.control.inverse_dynamics import invert_dynamics
from fbid_gym.control.limited_inverse_dynamics import limit_dynamics
from fbid_gym.control.underactuation import underactuation
from fbid_gym.dynamics.contacts import reduce_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.quantities import (
    ActivePoints,
    Constraint,
    ContactGeometry,
    DynamicsTerms,
    EquationOfMotion,
    Memory,
    Nearness,
    PointLimits,
    ReducedContacts,
    Reference,
    RobotState,
    some_of,
)
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import copy


class LawConstants(NamedTuple):
    """Of the law on one robot, see `AccelerationLaw`.

    Attributes:
        geometry: of the contact points.
        limits: (1, P, 3) of `limit_rows`.
        nearness: of accelerations and wrenches.
        gravity: m/s².
        passive: what joints take of their torques, to be given back.
    """

    geometry: ContactGeometry
    limits: np.ndarray
    nearness: Nearness
    gravity: float
    passive: PassiveJoints


@dataclass(frozen=True, eq=False)
class AccelerationLaw:
    """[M10] eq. (15) on a robot's feet, with or without limits on the contact forces.

    Attributes:
        robot: whose joints.
        belief: which points are taken to be in contact.
        ramp: leads from one set of contacts to the next; None where the torque may jump.
        constants: of the law.
        limited: whether contact forces have limits; else they can pull and never slip.
    """

    robot: Robot
    belief: ContactBelief
    ramp: ContactRamp | None
    constants: LawConstants
    limited: bool

    @classmethod
    def of(
        cls, robot: Robot, control_hz: int, contact: ContactOptions, *, base_priority: float
    ) -> "AccelerationLaw":
        """Build the law on what `contact` says of the contacts.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            contact: the options.
            base_priority: weight of base accelerations beside one for the joints, where the
                contacts do not allow both.
        """
        stance, limits = Stance.of(robot), contact.limits(robot)
        constants = LawConstants(
            geometry=stance.geometry,
            limits=limit_rows(limits or ContactLimits(), robot.num_points),
            nearness=Nearness(stance.mobility(base_priority), wrench_scale(stance.length, None)),
            gravity=robot.gravity,
            passive=contact.passive(robot),
        )
        return cls(
            robot=robot,
            belief=contact.belief(robot, control_hz),
            ramp=contact.ramp(control_hz),
            constants=constants,
            limited=limits is not None,
        )

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """What of its memory it reports."""
        return diagnostics_of(self.limited)

    def memory(self, num_robots: int) -> Memory:
        """Warm start of the contact forces, the diagnostics, and a ramp's state."""
        return fresh_memory(num_robots, self.ramp, self.robot.num_points, self.robot.num_joints)

    def torque(
        self,
        desired: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: DynamicsTerms,
        memory: Memory,
    ) -> np.ndarray:
        """Return joint torques.

        Args:
            desired: (N, nv) m/s^2 and rad/s^2, acceleration to come nearest to.
            state: of the robots.
            reference: which plans the contacts.
            terms: of the robots.
            memory: of the robots; updated.

        Returns:
            (N, n) N·m.
        """
        active, own = self.belief(state, reference), LawMemory.of(memory)
        torque = self._invert(active, terms, state, desired, own)

        def of_contacts(rows: np.ndarray, active: ActivePoints) -> np.ndarray:
            robots = some_of(terms, rows), some_of(state, rows), desired[rows]
            return self._invert(active, *robots, some_of(own, rows))

        return through_contact_switches(self.ramp, active, torque, of_contacts, memory)

    @cached_property
    def _invert(self) -> Callable[..., np.ndarray]:
        # Chosen here and not in compiled code: what a layer does not use is then not compiled.
        return bind(_within_limits if self.limited else _without_limits, self.constants)


@kernel
def _within_limits(
    law: LawConstants,
    active: ActivePoints,
    terms: DynamicsTerms,
    state: RobotState,
    desired: np.ndarray,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) for accelerations (N, nv); updates the memory."""
    contacts = reduce_contacts(law.geometry, active, terms)
    return torque_within_limits(law, active, contacts, terms, state, desired, memory)


@kernel
def _without_limits(
    law: LawConstants,
    active: ActivePoints,
    terms: DynamicsTerms,
    state: RobotState,
    desired: np.ndarray,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) for accelerations (N, nv) by eq. (15); updates the memory."""
    contacts = reduce_contacts(law.geometry, active, terms)
    return torque_without_limits(law, contacts, terms, state, desired, memory)


@compiled
def torque_within_limits(
    law: LawConstants,
    active: ActivePoints,
    contacts: ReducedContacts,
    terms: DynamicsTerms,
    state: RobotState,
    desired: np.ndarray,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) for accelerations (N, nv) on given contacts; updates the memory."""
    found = limit_dynamics(
        EquationOfMotion(terms.mass_matrix, terms.bias),
        contacts,
        desired,
        PointLimits(law.limits, active.mask),
        law.nearness,
        DEFAULT_ACCURACY,
        law.gravity,
        memory.warm_start,
    )
    remember(found.warm_start, found.residual, memory)
    if active.switching:
        copy(underactuation(contacts.jacobian), memory.underactuation)
    return give_back(law.passive, found.torque, state.qpos, state.qvel)


@compiled
def torque_without_limits(
    law: LawConstants,
    contacts: ReducedContacts,
    terms: DynamicsTerms,
    state: RobotState,
    desired: np.ndarray,
    memory: LawMemory,
) -> np.ndarray:
    """The same by eq. (15)."""
    constraint = Constraint(contacts.jacobian, contacts.bias)
    motion = EquationOfMotion(terms.mass_matrix, terms.bias)
    alike = np.empty((0, desired.shape[1] - 6))
    found = invert_dynamics(motion, constraint, desired, alike, law.nearness.mobility)
    copy(found.underactuation, memory.underactuation)
    return give_back(law.passive, found.torque, state.qpos, state.qvel)
