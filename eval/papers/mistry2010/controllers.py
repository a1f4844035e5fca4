"""The controllers of [M10] section IV: joint PD, with and without inverse dynamics ahead of it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from eval.papers.trial import Command, Memory, contact_points
from fbid_gym.actions.contact_belief import TOUCH
from fbid_gym.actions.stance import holding_torque, own_inertia, stance_inertia
from fbid_gym.control import ContactLimits, limited_inverse_dynamics, orthogonal_inverse_dynamics
from fbid_gym.dynamics.contacts import ContactGeometry, ReducedContacts, reduced_contacts
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.support import Support
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot

JOINTS_FIRST = 1e-3
"""Weight of base accelerations beside joint accelerations where the contacts do not allow both:
the reference's joint accelerations are kept, and the base follows."""


@dataclass(frozen=True, eq=False)
class Gains:
    """Joint PD gains, K_P = I w^2 and K_D = 2 zeta I w; I is each joint's inertia in stance.

    Attributes:
        stiffness: (n,) or (N, n) N·m/rad.
        damping: the same shape, N·m·s/rad.
    """

    stiffness: np.ndarray
    damping: np.ndarray

    @classmethod
    def of(cls, robot: Robot, hertz: float | np.ndarray, zeta: float | np.ndarray = 1.0) -> "Gains":
        """Derive gains from a natural frequency (Hz) and a damping ratio, or from N of each.

        The damping stays below the inertia that a joint moves in the air times the control rate,
        beyond which sampled damping itself oscillates.
        """
        inertia = stance_inertia(robot)
        omega = 2.0 * np.pi * np.asarray(hertz, float)[..., None]
        damping = 2.0 * np.asarray(zeta, float)[..., None] * omega * inertia
        return cls(inertia * omega**2, np.minimum(damping, own_inertia(robot) * 500.0))

    def torque(self, state: RobotState, reference: Reference) -> np.ndarray:
        """K_P (q_d - q) + K_D (qdot_d - qdot): (N, n) N·m."""
        error = reference.qpos[:, 7:] - state.qpos[:, 7:]
        rate = reference.qvel[:, 6:] - state.qvel[:, 6:]
        return self.stiffness * error + self.damping * rate


class Feedforward(Protocol):
    """Inverse dynamics: the torque for a desired acceleration."""

    def memory(self, num_robots: int) -> Memory:
        """Return what the law remembers, for robots that have not moved yet."""
        ...

    def __call__(
        self,
        acceleration: np.ndarray,
        contacts: ReducedContacts,
        active: np.ndarray | None,
        state: RobotState,
        terms: DynamicsTerms,
        memory: Memory,
    ) -> np.ndarray:
        """Return (N, n) N·m for accelerations (N, nv) with the `active` points (N, P) down."""
        ...


@dataclass(frozen=True, eq=False)
class Orthogonal:
    """[M10] eq. (15), with the weights of eq. (16) if any: contacts that pull and never slip.

    Attributes:
        torque_cost: (n,) diagonal of W; None for the identity.
    """

    torque_cost: np.ndarray | None = None

    def memory(self, num_robots: int) -> Memory:
        """Nothing to remember."""
        return {}

    def __call__(
        self,
        acceleration: np.ndarray,
        contacts: ReducedContacts,
        active: np.ndarray | None,
        state: RobotState,
        terms: DynamicsTerms,
        memory: Memory,
    ) -> np.ndarray:
        """See `Feedforward`."""
        return np.asarray(
            orthogonal_inverse_dynamics(
                terms.mass_matrix,
                terms.bias,
                contacts.jacobian,
                acceleration,
                contacts.bias,
                torque_cost=self.torque_cost,
                base_priority=JOINTS_FIRST,
            ).torque
        )


@dataclass(frozen=True, eq=False)
class Limited:
    """The same with contact forces that the ground can deliver; not in the paper.

    Attributes:
        limits: of the contact forces.
        length: m, lever arm that makes moments comparable to forces.
        base_priority: weight of base accelerations beside one for the joints.
        wrench_cost: six weights of the errors of the base's forces and moments, where the ground
            cannot give both.
    """

    limits: ContactLimits
    length: float
    base_priority: float = JOINTS_FIRST
    wrench_cost: tuple[float, ...] | None = None

    @classmethod
    def of(cls, robot: Robot, friction: float = 0.7) -> "Limited":
        """Friction cones of the given coefficient."""
        return cls(ContactLimits(friction), Support.of(robot).radius)

    def memory(self, num_robots: int) -> Memory:
        """The warm start of the contact forces."""
        return {"warm_start": np.zeros((num_robots, 6)), "residual": np.zeros(num_robots)}

    def __call__(
        self,
        acceleration: np.ndarray,
        contacts: ReducedContacts,
        active: np.ndarray | None,
        state: RobotState,
        terms: DynamicsTerms,
        memory: Memory,
    ) -> np.ndarray:
        """See `Feedforward`."""
        found = limited_inverse_dynamics(
            terms.mass_matrix,
            terms.bias,
            contacts.jacobian,
            acceleration,
            contacts.bias,
            self.limits,
            point_map=contacts.point_map,
            active=active,
            base_priority=self.base_priority,
            length=self.length,
            wrench_cost=self.wrench_cost,
            warm_start=memory["warm_start"],
        )
        memory["warm_start"], memory["residual"] = found.warm_start, found.residual
        return np.asarray(found.torque)


Belief = Callable[[RobotState, Reference], np.ndarray | None]
"""Which contact points a controller takes to be on the ground: (N, P) bool, None for all."""


def measured_contacts(robot: Robot) -> Belief:
    """Believe in the points that carried weight during the last physics step."""
    least = TOUCH * robot.weight
    return lambda state, reference: np.linalg.norm(state.contact_force, axis=2) > least


class Motive(Protocol):
    """Which acceleration the robots shall have: what the inverse dynamics is given."""

    def __call__(
        self,
        state: RobotState,
        terms: DynamicsTerms,
        reference: Reference,
        contacts: ReducedContacts,
        memory: Memory,
    ) -> np.ndarray:
        """Return (N, nv) m/s^2 and rad/s^2."""
        ...


@dataclass(frozen=True, eq=False)
class Planned:
    """The reference's acceleration, its linear part turned into the world.

    Attributes:
        support: of the robot.
    """

    support: Support

    def __call__(
        self,
        state: RobotState,
        terms: DynamicsTerms,
        reference: Reference,
        contacts: ReducedContacts,
        memory: Memory,
    ) -> np.ndarray:
        """See `Motive`."""
        acceleration = reference.qacc.copy()
        rotation = self.support.frame(terms).rotation
        acceleration[:, :3] = np.matvec(rotation, acceleration[:, :3])
        return acceleration


@dataclass(frozen=True, eq=False)
class Tracking:
    """[M10] eq. (18): inverse dynamics of a desired acceleration, and joint PD.

    Viscous damping of the joints is known to the robot's model but is not part of h; where there is
    inverse dynamics, it is compensated.

    Attributes:
        robot: whose joints.
        gains: of the feedback.
        law: the inverse dynamics; None for PD alone.
        belief: which contacts it counts on; None for the planned ones.
        motive: which acceleration is desired; None for the reference's.
    """

    robot: Robot
    gains: Gains
    law: Feedforward | None = None
    belief: Belief | None = None
    motive: Motive | None = None
    geometry: ContactGeometry = field(init=False)
    planned: Planned = field(init=False)

    def __post_init__(self) -> None:
        """Measure the feet."""
        object.__setattr__(self, "geometry", ContactGeometry.of(self.robot))
        object.__setattr__(self, "planned", Planned(Support.of(self.robot)))

    def memory(self, num_robots: int) -> Memory:
        """See `Controller`."""
        if self.law is None:
            return {}
        home = np.tile(holding_torque(self.robot), (num_robots, 1))
        return self.law.memory(num_robots) | {"applied": home, "feedforward": home}

    def __call__(
        self, state: RobotState, terms: DynamicsTerms, reference: Reference, memory: Memory
    ) -> Command:
        """See `Controller`."""
        feedback = self.gains.torque(state, reference)
        if self.law is None:
            return Command(np.zeros_like(feedback), feedback)
        if self.belief is None:
            active = contact_points(self.geometry, reference.planted)
        else:
            active = self.belief(state, reference)
        contacts = reduced_contacts(self.geometry, terms, active)
        motive = self.planned if self.motive is None else self.motive
        acceleration = motive(state, terms, reference, contacts, memory)
        torque = self.law(acceleration, contacts, active, state, terms, memory)
        limit, friction = self.robot.torque_limit, self.robot.joint_damping * state.qvel[:, 6:]
        # What acts on the robot's rigid bodies: the motors' torque less the joints' friction.
        memory["applied"] = np.clip(torque + friction + feedback, -limit, limit) - friction
        memory["feedforward"] = torque
        return Command(torque + friction, feedback)
