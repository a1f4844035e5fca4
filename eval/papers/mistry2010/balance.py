"""[M10] IV.D: joint tracking with an operational-space command of the base, eqs. (19)-(20)."""

from dataclasses import dataclass, field

import numpy as np

from eval.papers.mistry2010.controllers import Belief, Feedforward, Gains
from eval.papers.trial import Command, Memory, contact_points
from fbid_gym.actions.stance import holding_torque
from fbid_gym.control import operational_space_acceleration, task_acceleration
from fbid_gym.dynamics.contacts import ContactGeometry, reduced_contacts
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.support import Support
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot


@dataclass(frozen=True, eq=False)
class Balancing:
    """Eq. (18), where the inverse dynamics gets the acceleration of eqs. (19) and (20).

    Attributes:
        robot: whose joints.
        gains: of the joint feedback.
        law: the inverse dynamics.
        stiffness: K_P of the base, 1/s^2.
        damping: K_D of the base, 1/s.
        joint_reference: whether eq. (19) stays near the reference's accelerations; in the paper it
            stays near zero.
        belief: which contacts it counts on; None for the planned ones.
    """

    robot: Robot
    gains: Gains
    law: Feedforward
    stiffness: float
    damping: float
    joint_reference: bool = False
    belief: Belief | None = None
    geometry: ContactGeometry = field(init=False)
    support: Support = field(init=False)

    def __post_init__(self) -> None:
        """Measure the feet."""
        object.__setattr__(self, "geometry", ContactGeometry.of(self.robot))
        object.__setattr__(self, "support", Support.of(self.robot))

    def memory(self, num_robots: int) -> Memory:
        """See `Controller`."""
        home = np.tile(holding_torque(self.robot), (num_robots, 1))
        nothing = np.zeros((num_robots, 2))
        kept = {"applied": home, "feedforward": home, "base": nothing, "base_target": nothing}
        return self.law.memory(num_robots) | kept

    def __call__(
        self, state: RobotState, terms: DynamicsTerms, reference: Reference, memory: Memory
    ) -> Command:
        """See `Controller`."""
        feedback = self.gains.torque(state, reference)
        if self.belief is None:
            active = contact_points(self.geometry, reference.planted)
        else:
            active = self.belief(state, reference)
        contacts = reduced_contacts(self.geometry, terms, active)
        acceleration = self.acceleration(state, terms, reference, contacts, memory)
        torque = self.law(acceleration, contacts, active, state, terms, memory)
        limit, friction = self.robot.torque_limit, self.robot.joint_damping * state.qvel[:, 6:]
        memory["applied"] = np.clip(torque + friction + feedback, -limit, limit) - friction
        memory["feedforward"] = torque
        return Command(torque + friction, feedback)
    
    def acceleration(self, state, terms, reference, contacts, memory):
        frame = self.support.frame(terms)
        there = frame.centre + np.matvec(frame.rotation, reference.qpos[:, :3])
        memory["base"] = np.vecmat(terms.base_position-frame.centre, frame.rotation)[:, :2]
        memory["base_target"] = reference.qpos[:, :2] + np.zeros((len(there),2))
        vel = acc = None
        ref = None
        if self.joint_reference:
            vel = np.matvec(frame.rotation, reference.qvel[:, :3])[:, :2]
            acc = np.matvec(frame.rotation, reference.qacc[:, :3])[:, :2]
            ref = reference.qacc.copy(); ref[:, :3] = np.matvec(frame.rotation, ref[:, :3])
        task = task_acceleration(there[:, :2], terms.base_position[:, :2], state.qvel[:, :2], self.stiffness, self.damping,
            desired_velocity=vel, desired_acceleration=acc)
        nv = state.qvel.shape[1]
        return operational_space_acceleration(contacts.jacobian, contacts.bias, np.eye(nv)[:2], None, task, ref).motion
