"""From a desired acceleration to joint torques: what the acceleration layers share."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.acceleration_tick import acceleration_tick
from fbid_gym.actions.contact_belief import ContactBelief
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.contact_ramp import ContactRamp
from fbid_gym.actions.layer import Memory
from fbid_gym.control import (
    ContactLimits,
    operational_space_acceleration,
    orthogonal_inverse_dynamics,
)
from fbid_gym.control.arrays import as_flags
from fbid_gym.control.contact_forces import limit_rows, wrench_scale
from fbid_gym.dynamics.contacts import ContactGeometry, reduced_contacts
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.support import Support
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot

DIAGNOSTICS = ("residual", "underactuation")
"""Share of the weight by which the base wrench misses the commanded one; and the number of base
directions that the assumed contacts cannot push."""


class Task(NamedTuple):
    """What a part of N robots shall do, before the joints do theirs: [M10] eq. (19).

    Attributes:
        jacobian: (N, m, nv) of the part's velocity.
        bias: (N, m) its rate times the velocity.
        acceleration: (N, m) wanted.
    """

    jacobian: np.ndarray
    bias: np.ndarray
    acceleration: np.ndarray


@dataclass(frozen=True, eq=False)
class AccelerationLaw:
    """[M10] eq. (15) on a robot's feet, with or without limits on the contact forces.

    Attributes:
        robot: whose joints.
        geometry: of its contact points.
        belief: which points are taken to be in contact.
        limits: on their forces; None for the paper's form.
        ramp: leads from one set of contacts to the next; None where the torque may jump.
        base_priority: weight of base accelerations beside one for the joints, where the contacts do
            not allow both.
        damping: (n,) N·m·s/rad of the joints, to be compensated; zero for none.
        length: m, lever arm that makes moments on the base comparable to forces.
        no_task: of no rows, (1, 0, nv) and (1, 0).
    """

    robot: Robot
    geometry: ContactGeometry
    belief: ContactBelief
    limits: ContactLimits | None
    ramp: ContactRamp | None
    base_priority: float
    damping: np.ndarray
    length: float
    no_task: Task

    @classmethod
    def of(
        cls, robot: Robot, control_hz: int, contact: ContactOptions, *, base_priority: float
    ) -> "AccelerationLaw":
        """Build the law on what `contact` says of the contacts."""
        return cls(
            robot=robot,
            geometry=ContactGeometry.of(robot),
            belief=contact.belief(robot, control_hz),
            limits=contact.limits(robot),
            ramp=contact.ramp(control_hz),
            base_priority=base_priority,
            damping=contact.damping(robot),
            length=Support.of(robot).radius or 1.0,
            no_task=Task(np.empty((1, 0, robot.nv)), np.empty((1, 0)), np.empty((1, 0))),
        )

    def memory(self, num_robots: int) -> Memory:
        """Warm start of the contact forces, the diagnostics, and a ramp's state."""
        memory = {
            "warm_start": np.zeros((num_robots, 6)),
            "residual": np.zeros(num_robots),
            "underactuation": np.zeros(num_robots),
        }
        if self.ramp is not None:
            sizes = self.robot.num_points, self.robot.num_joints
            memory |= self.ramp.memory(num_robots, *sizes)
        return memory

    def torque(
        self,
        acceleration: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: DynamicsTerms,
        memory: Memory,
        task: Task | None = None,
    ) -> np.ndarray:
        """Return joint torques.

        Args:
            acceleration: (N, nv) m/s^2 and rad/s^2 to come nearest to.
            state: of the robots.
            reference: which plans the contacts.
            terms: of the robots.
            memory: of the robots; updated.
            task: to be met before `acceleration`, which is followed in what contacts and task
                leave; None for none.

        Returns:
            (N, n) N·m.
        """
        active, start = self.belief(state, reference), memory["warm_start"]
        torque, found = self._solve(acceleration, state.qvel, task, terms, active, start)
        memory.update(found)
        if self.ramp is None or active is None:
            return torque

        def of_contacts(rows: np.ndarray, contacts: np.ndarray) -> np.ndarray:
            part = None if task is None else Task(*(value[rows] for value in task))
            some = DynamicsTerms(*(value[rows] for value in terms))
            robots = acceleration[rows], state.qvel[rows], part, some
            return self._solve(*robots, contacts, start[rows])[0]

        return self.ramp.torque(torque, active, of_contacts, memory)

    def _solve(
        self,
        acceleration: np.ndarray,
        velocity: np.ndarray,
        task: Task | None,
        terms: DynamicsTerms,
        active: np.ndarray | None,
        start: np.ndarray,
    ) -> tuple[np.ndarray, Memory]:
        """Torques (N, n) with one set of contacts, and what goes into the memory."""
        if self.limits is None:
            return self._solve_freely(acceleration, velocity, task, terms, active)
        geometry, count = self.geometry, len(acceleration)
        torque, residual = np.empty((count, len(self.damping))), np.empty(count)
        warm_start, missing = np.empty((count, 6)), np.empty(count)
        acceleration_tick(
            geometry.foot_of_point,
            geometry.slot_of_point,
            geometry.offset,
            geometry.motion,
            geometry.spread,
            active is not None,
            geometry.every if active is None else as_flags(active),
            terms.foot_rotation,
            terms.foot_velocity,
            terms.foot_jacobian,
            terms.foot_bias,
            terms.mass_matrix,
            terms.bias,
            np.ascontiguousarray(velocity),
            acceleration,
            *(self.no_task if task is None else task),
            limit_rows(self.limits, geometry.num_points),
            wrench_scale(self.length, None),
            1.0 / self.base_priority,
            self.length,
            self.damping,
            start,
            torque,
            residual,
            warm_start,
            missing,
        )
        memory = {"warm_start": warm_start, "residual": residual}
        if active is not None:
            memory["underactuation"] = missing
        return torque, memory

    def _solve_freely(
        self,
        acceleration: np.ndarray,
        velocity: np.ndarray,
        task: Task | None,
        terms: DynamicsTerms,
        active: np.ndarray | None,
    ) -> tuple[np.ndarray, Memory]:
        """The same in the paper's form, without limits."""
        contacts = reduced_contacts(self.geometry, terms, active)
        if task is not None:
            acceleration = operational_space_acceleration(
                contacts.jacobian, contacts.bias, *task, reference=acceleration
            ).motion
        found = orthogonal_inverse_dynamics(
            terms.mass_matrix,
            terms.bias,
            contacts.jacobian,
            acceleration,
            contacts.bias,
            base_priority=self.base_priority,
        )
        torque = found.torque + self.damping * velocity[:, 6:]
        return torque, {"underactuation": found.underactuation.astype(float)}
