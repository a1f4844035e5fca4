"""The papers' balancers: from a desired wrench at the centre of mass to joint torques.

They are for motions that are planned; of these some feet may swing.
"""

from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.contact_belief import ContactBelief, contact_belief
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.contact_ramp import ContactRamp
from fbid_gym.actions.law import DIAGNOSTICS, fresh_memory
from fbid_gym.control.body_law import LawMemory
from fbid_gym.control.contact_forces import ContactLimits, limit_rows, wrench_scale
from fbid_gym.control.momentum_balance import (
    MomentumBalance,
    PostureGains,
    balance_torque,
    desired_wrench,
)
from fbid_gym.dynamics.centroidal import find_centroidal_terms
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.support import support_frame
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target, WrenchGains
from fbid_gym.robots import Robot


@dataclass(frozen=True, eq=False)
class BalanceLaw:
    """A balancer on a robot's feet; F feet, P points."""

    robot: Robot  # whose joints
    belief: ContactBelief  # which points are taken to be in contact
    # Leads from one set of contacts to the next; None where the torque may jump.
    ramp: ContactRamp | None
    constants: MomentumBalance  # of the law

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        contact: ContactOptions,
        balancer: int,
        gains: tuple[WrenchGains, PostureGains],
        moment_priority: float,
        push: np.ndarray,
    ) -> "BalanceLaw":
        """Build the law on what `contact` says of the contacts; `push` is that of action 1."""
        stance, limits = Stance.of(robot), contact.limits(robot)
        cost = (1.0,) * 3 + (moment_priority,) * 3
        constants = MomentumBalance(
            balancer,
            *gains,
            push=push,
            gravity=robot.gravity,
            geometry=stance.geometry,
            heading=stance.heading,
            legs=stance.legs,
            limits=limit_rows(limits or ContactLimits(), robot.num_points),
            torque_limit=robot.torque_limit[None].copy(),
            weight=np.array([robot.weight]),
            scale=wrench_scale(stance.length, cost if limits is not None else None),
            passive=contact.passive(robot),
            limited=limits is not None,
        )
        belief = contact_belief(contact.contacts, robot, control_hz)
        return cls(robot, belief, contact.ramp(control_hz), constants)

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """The wrench's residual, and the directions in which contacts cannot push."""
        return DIAGNOSTICS

    def memory(self, num_robots: int) -> Memory:
        """Return the memory of robots that have not moved yet."""
        return fresh_memory(self.robot, self.ramp, num_robots)

    def torque(
        self,
        action: np.ndarray,
        state: RobotState,
        target: Target,
        terms: DynamicsTerms,
        memory: Memory,
    ) -> np.ndarray:
        """Return joint torques, (N, n) N·m; arguments as of `ActionLayer.torque`."""
        active, own = self.belief(state, target), LawMemory.of(memory)
        torque = balance_torque(self.constants, active, action, state, target, terms, own)
        return torque if self.ramp is None else self.ramp.torque(torque, active, memory)

    def desired(
        self, action: np.ndarray, state: RobotState, target: Target, terms: DynamicsTerms
    ) -> np.ndarray:
        """Return the acceleration that it asks of the centre of mass, (N, 3) m/s^2, world."""
        law, body = self.constants, find_centroidal_terms(terms, state.qvel)
        frame, push = support_frame(law.heading, terms), law.push * action
        wrench = desired_wrench(law.wrench, law.gravity, push, state, target, terms, body, frame)
        return wrench[:, :3] / body.mass[:, None] - np.array([0.0, 0.0, law.gravity])
