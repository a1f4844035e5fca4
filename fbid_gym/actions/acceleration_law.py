"""From a desired acceleration to joint torques: what the acceleration layers share."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.contact_belief import ContactBelief
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.contact_ramp import ContactRamp, through_contact_switches
from fbid_gym.actions.law_memory import LawMemory, diagnostics_of, remember
from fbid_gym.actions.passive_joints import PassiveJoints, give_back
from fbid_gym.compiled import compiled, kernel
from fbid_gym.control import ContactLimits
from fbid_gym.control.contact_forces import DEFAULT_ACCURACY, limit_rows, wrench_scale
from fbid_gym.control.inverse_dynamics import invert_dynamics
from fbid_gym.control.limited_inverse_dynamics import limit_dynamics
from fbid_gym.control.operational_space import LEAST_GAIN, serve_task
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
    TaskCommand,
)
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import copy


class _Constants(NamedTuple):
    """Of the law on one robot, see `AccelerationLaw`.

    Attributes:
        geometry: of the contact points.
        limits: (1, P, 3) of `limit_rows`.
        least_gain: m, of a task that goes first, see `operational_space`.
        nearness: of accelerations and wrenches.
        gravity: m/s².
        passive: what joints take of their torques, to be given back.
    """

    geometry: ContactGeometry
    limits: np.ndarray
    least_gain: float
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
    constants: _Constants
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
        constants = _Constants(
            geometry=stance.geometry,
            limits=limit_rows(limits or ContactLimits(), robot.num_points),
            least_gain=LEAST_GAIN * stance.home_com[2],
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
        memory = LawMemory.fresh(num_robots)._asdict()
        if self.ramp is not None:
            sizes = self.robot.num_points, self.robot.num_joints
            memory |= self.ramp.memory(num_robots, *sizes)
        return memory

    def torque(
        self,
        desired: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: DynamicsTerms,
        memory: Memory,
        task: TaskCommand | None = None,
    ) -> np.ndarray:
        """Return joint torques.

        Args:
            desired: (N, nv) m/s^2 and rad/s^2, acceleration to come nearest to.
            state: of the robots.
            reference: which plans the contacts.
            terms: of the robots.
            memory: of the robots; updated.
            task: to be met before `desired`, which is followed in what contacts and task leave;
                None for none.

        Returns:
            (N, n) N·m.
        """
        active, own = self.belief(state, reference), LawMemory.of(memory)
        torque = self._realise(active, terms, state, desired, task, own)

        def of_contacts(rows: np.ndarray, active: ActivePoints) -> np.ndarray:
            some = DynamicsTerms(*(value[rows] for value in terms))
            part = None if task is None else TaskCommand(*(value[rows] for value in task))
            robots = some, RobotState(*(value[rows] for value in state)), desired[rows], part
            return self._realise(active, *robots, own.copy(rows))

        return through_contact_switches(self.ramp, active, torque, of_contacts, memory)

    def _realise(
        self,
        active: ActivePoints,
        terms: DynamicsTerms,
        state: RobotState,
        desired: np.ndarray,
        task: TaskCommand | None,
        memory: LawMemory,
    ) -> np.ndarray:
        # Chosen here and not in compiled code: what a layer does not use is then not compiled.
        robots = terms, state, desired
        if task is not None and task.acceleration.shape[1] > 0:
            serve = _serve_within_limits if self.limited else _serve_without_limits
            return serve(self.constants, active, *robots, task, memory)
        realise = _realise_within_limits if self.limited else _realise_without_limits
        return realise(self.constants, active, *robots, memory)


@kernel
def _realise_within_limits(
    law: _Constants,
    active: ActivePoints,
    terms: DynamicsTerms,
    state: RobotState,
    desired: np.ndarray,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) for accelerations (N, nv); updates the memory."""
    contacts = reduce_contacts(law.geometry, active, terms)
    return _within_limits(law, active, contacts, terms, state, desired, memory)


@kernel
def _serve_within_limits(
    law: _Constants,
    active: ActivePoints,
    terms: DynamicsTerms,
    state: RobotState,
    desired: np.ndarray,
    task: TaskCommand,
    memory: LawMemory,
) -> np.ndarray:
    """The same where a task comes before the accelerations."""
    contacts = reduce_contacts(law.geometry, active, terms)
    served = _served(law, contacts, task, desired)
    return _within_limits(law, active, contacts, terms, state, served, memory)


@kernel
def _realise_without_limits(
    law: _Constants,
    active: ActivePoints,
    terms: DynamicsTerms,
    state: RobotState,
    desired: np.ndarray,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) for accelerations (N, nv) by eq. (15); updates the memory."""
    contacts = reduce_contacts(law.geometry, active, terms)
    return _without_limits(law, contacts, terms, state, desired, memory)


@kernel
def _serve_without_limits(
    law: _Constants,
    active: ActivePoints,
    terms: DynamicsTerms,
    state: RobotState,
    desired: np.ndarray,
    task: TaskCommand,
    memory: LawMemory,
) -> np.ndarray:
    """The same where a task comes before the accelerations."""
    contacts = reduce_contacts(law.geometry, active, terms)
    served = _served(law, contacts, task, desired)
    return _without_limits(law, contacts, terms, state, served, memory)


@compiled
def _served(
    law: _Constants, contacts: ReducedContacts, task: TaskCommand, desired: np.ndarray
) -> np.ndarray:
    """The accelerations (N, nv) that meet a task in m, then are as desired: eq. (19)."""
    constraint = Constraint(contacts.jacobian, contacts.bias)
    least = np.full(task.acceleration.shape[1], law.least_gain)
    return serve_task(constraint, task, desired, law.nearness.mobility, least).motion


@compiled
def _within_limits(
    law: _Constants,
    active: ActivePoints,
    contacts: ReducedContacts,
    terms: DynamicsTerms,
    state: RobotState,
    desired: np.ndarray,
    memory: LawMemory,
) -> np.ndarray:
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
def _without_limits(
    law: _Constants,
    contacts: ReducedContacts,
    terms: DynamicsTerms,
    state: RobotState,
    desired: np.ndarray,
    memory: LawMemory,
) -> np.ndarray:
    constraint = Constraint(contacts.jacobian, contacts.bias)
    motion = EquationOfMotion(terms.mass_matrix, terms.bias)
    alike = np.empty((0, desired.shape[1] - 6))
    found = invert_dynamics(motion, constraint, desired, alike, law.nearness.mobility)
    copy(found.underactuation, memory.underactuation)
    return give_back(law.passive, found.torque, state.qpos, state.qvel)
