"""From a desired acceleration to joint torques: what the acceleration layers share."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.contact_belief import ContactBelief
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.contact_ramp import ContactRamp
from fbid_gym.actions.layer import Memory
from fbid_gym.control import (
    ContactLimits,
    limited_inverse_dynamics,
    operational_space_acceleration,
    orthogonal_inverse_dynamics,
    underactuation,
)
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


class _Solution(NamedTuple):
    """Torques (N, n) of one set of contacts, and what goes into the memory."""

    torque: np.ndarray
    memory: Memory


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
    """

    robot: Robot
    geometry: ContactGeometry
    belief: ContactBelief
    limits: ContactLimits | None
    ramp: ContactRamp | None
    base_priority: float
    damping: np.ndarray
    length: float

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
        active = self.belief(state, reference)
        warm_start = memory["warm_start"]
        solution = self._solve(acceleration, task, terms, active, warm_start)
        memory.update(solution.memory)
        torque = solution.torque
        if self.ramp is not None and active is not None:

            def of_contacts(rows: np.ndarray, contacts: np.ndarray) -> np.ndarray:
                part = None if task is None else Task(*(value[rows] for value in task))
                some = DynamicsTerms(*(value[rows] for value in terms))
                arguments = acceleration[rows], part, some, contacts, warm_start[rows]
                return self._solve(*arguments).torque

            torque = self.ramp.torque(torque, active, of_contacts, memory)
        return torque + self.damping * state.qvel[:, 6:]

    def _solve(
        self,
        acceleration: np.ndarray,
        task: Task | None,
        terms: DynamicsTerms,
        active: np.ndarray | None,
        warm_start: np.ndarray,
    ) -> _Solution:
        contacts = reduced_contacts(self.geometry, terms, active)
        if task is not None:
            acceleration = operational_space_acceleration(
                contacts.jacobian, contacts.bias, *task, reference=acceleration
            ).motion
        arguments = (
            terms.mass_matrix,
            terms.bias,
            contacts.jacobian,
            acceleration,
            contacts.bias,
        )
        if self.limits is None:
            free = orthogonal_inverse_dynamics(*arguments, base_priority=self.base_priority)
            return _Solution(free.torque, {"underactuation": free.underactuation.astype(float)})
        limited = limited_inverse_dynamics(
            *arguments,
            self.limits,
            point_map=contacts.point_map,
            active=active,
            base_priority=self.base_priority,
            length=self.length,
            warm_start=warm_start,
        )
        memory = {"warm_start": limited.warm_start, "residual": limited.residual}
        if active is not None:
            memory["underactuation"] = underactuation(contacts.jacobian)
        return _Solution(limited.torque, memory)
