"""From a desired acceleration to joint torques: what the acceleration layers share."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.contact_belief import ContactBelief
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.contact_ramp import ContactRamp, through_contact_switches
from fbid_gym.actions.law_memory import LawMemory
from fbid_gym.compiled import kernel
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
    Reference,
    RobotState,
    TaskCommand,
)
from fbid_gym.robots import Robot


class _Constants(NamedTuple):
    """Of the law on one robot, see `AccelerationLaw`.

    Attributes:
        geometry: of the contact points.
        limited: whether contact forces have limits; else they can pull and never slip.
        limits: (1, P, 3) of `limit_rows`.
        nearness: of accelerations and wrenches.
        gravity: m/s².
        damping: (n,) N·m·s/rad of the joints, to be compensated; zero for none.
    """

    geometry: ContactGeometry
    limited: bool
    limits: np.ndarray
    nearness: Nearness
    gravity: float
    damping: np.ndarray


@dataclass(frozen=True, eq=False)
class AccelerationLaw:
    """[M10] eq. (15) on a robot's feet, with or without limits on the contact forces.

    Attributes:
        robot: whose joints.
        belief: which points are taken to be in contact.
        ramp: leads from one set of contacts to the next; None where the torque may jump.
        constants: of the law.
        no_task: of no rows.
    """

    robot: Robot
    belief: ContactBelief
    ramp: ContactRamp | None
    constants: _Constants
    no_task: TaskCommand

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
            limited=limits is not None,
            limits=limit_rows(limits or ContactLimits(), robot.num_points),
            nearness=Nearness(
                1.0 / base_priority, stance.length, wrench_scale(stance.length, None)
            ),
            gravity=robot.gravity,
            damping=contact.damping(robot),
        )
        none = np.empty((1, 0, robot.nv)), np.empty((1, 0)), np.empty((1, 0))
        return cls(
            robot=robot,
            belief=contact.belief(robot, control_hz),
            ramp=contact.ramp(control_hz),
            constants=constants,
            no_task=TaskCommand(*none),
        )

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
        part = self.no_task if task is None else task
        torque = _realise(self.constants, active, terms, state.qvel, desired, part, own)

        def of_contacts(rows: np.ndarray, active: ActivePoints) -> np.ndarray:
            some = DynamicsTerms(*(value[rows] for value in terms))
            few = part if task is None else TaskCommand(*(value[rows] for value in part))
            robots = some, state.qvel[rows], desired[rows], few
            return _realise(self.constants, active, *robots, own.copy(rows))

        return through_contact_switches(self.ramp, active, torque, of_contacts, memory)


@kernel
def _realise(
    law: _Constants,
    active: ActivePoints,
    terms: DynamicsTerms,
    velocity: np.ndarray,
    desired: np.ndarray,
    task: TaskCommand,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) for accelerations (N, nv), at velocities (N, nv); updates the memory."""
    contacts = reduce_contacts(law.geometry, active, terms)
    constraint = Constraint(contacts.jacobian, contacts.bias)
    motion = EquationOfMotion(terms.mass_matrix, terms.bias)
    if task.acceleration.shape[1] > 0:
        alike = np.ones(desired.shape[1])
        desired = serve_task(constraint, task, desired, alike, LEAST_GAIN).motion
    if law.limited:
        limits = PointLimits(law.limits, active.mask)
        found = limit_dynamics(
            motion,
            contacts,
            desired,
            limits,
            law.nearness,
            DEFAULT_ACCURACY,
            law.gravity,
            memory.warm_start,
        )
        torque = found.torque
        memory.warm_start[:], memory.residual[:] = found.warm_start, found.residual
        if active.switching:
            memory.underactuation[:] = underactuation(contacts.jacobian)
    else:
        alike = np.empty((0, desired.shape[1] - 6))
        free = invert_dynamics(motion, constraint, desired, alike, law.nearness.base_mobility)
        torque = free.torque
        memory.underactuation[:] = free.underactuation
    for i in range(len(torque)):
        for j in range(torque.shape[1]):
            torque[i, j] += law.damping[j] * velocity[i, 6 + j]
    return torque
