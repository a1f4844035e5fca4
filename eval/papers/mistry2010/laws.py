"""Inverse dynamics of [M10] and its rivals: the torque for a desired acceleration."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from eval.papers.mistry2010.force_feedback import (
    estimated_force_inverse_dynamics,
    force_feedback_inverse_dynamics,
    inertia_weighted_inverse_dynamics,
)
from eval.papers.mistry2010.force_sensor import ForceSensor
from eval.papers.mistry2010.metric import metric_inverse_dynamics
from eval.papers.trial import RATES, Memory
from fbid_gym.control import ContactLimits, limited_inverse_dynamics, orthogonal_inverse_dynamics
from fbid_gym.dynamics import DynamicsTerms
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.quantities import ContactGeometry, ReducedContacts, RobotState, Target
from fbid_gym.robots import Robot

JOINTS_FIRST = 1e-3
"""Weight of base accelerations beside joint accelerations where the contacts do not allow both:
the reference's joint accelerations are kept, and the base follows."""

Equation = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""M, h, J, desired acceleration and Jdot v: what every law of `fbid_gym.control` begins with."""


class Tick(NamedTuple):
    """What a controller knows on one tick.

    Attributes:
        state: of the robots.
        terms: their dynamics.
        reference: that they shall follow.
        active: (N, P) bool, the contact points that it counts on.
        contacts: of these points.
    """

    state: RobotState
    terms: DynamicsTerms
    reference: Target
    active: np.ndarray
    contacts: ReducedContacts

    def equation(self, acceleration: np.ndarray) -> Equation:
        """Return the equation of motion for accelerations (N, nv)."""
        return equation(self.terms, self.contacts, acceleration)


def equation(terms: DynamicsTerms, contacts: ReducedContacts, acceleration: np.ndarray) -> Equation:
    """Return the equation of motion of N robots that shall have accelerations (N, nv)."""
    return terms.mass_matrix, terms.bias, contacts.jacobian, acceleration, contacts.bias


class Law(Protocol):
    """From a desired acceleration (N, nv) to torques (N, n) N·m; it may remember in `memory`."""

    def memory(self, num_robots: int) -> Memory:
        """Return what the law remembers, for robots that have not moved yet."""
        ...

    def __call__(self, tick: Tick, acceleration: np.ndarray, memory: Memory) -> np.ndarray:
        """Return the torques for one control tick."""
        ...


@dataclass(frozen=True, eq=False)
class Memoryless:
    """A law that remembers nothing.

    Attributes:
        torque: its torques, (N, n) N·m.
    """

    torque: Callable[[Tick, np.ndarray], np.ndarray]

    def memory(self, num_robots: int) -> Memory:
        """Nothing to remember."""
        return {}

    def __call__(self, tick: Tick, acceleration: np.ndarray, memory: Memory) -> np.ndarray:
        """See `Law`."""
        return self.torque(tick, acceleration)


def orthogonal(torque_cost: np.ndarray | None = None) -> Law:
    """[M10] eq. (15): contacts that pull and never slip.

    Args:
        torque_cost: (n,) diagonal of W of eq. (16); None for the identity.
    """
    return Memoryless(
        lambda tick, desired: (
            orthogonal_inverse_dynamics(
                *tick.equation(desired), torque_cost=torque_cost, base_priority=JOINTS_FIRST
            ).torque
        )
    )


def inertia_weighted() -> Law:
    """The least torques by the inertia-weighted projection of eq. (7)."""
    return Memoryless(
        lambda tick, desired: inertia_weighted_inverse_dynamics(*tick.equation(desired)).torque
    )


def inertia_metric() -> Law:
    """Eq. (15) decomposed in the metric of the kinetic energy: inertia chooses among torques."""
    return Memoryless(
        lambda tick, desired: (
            metric_inverse_dynamics(*tick.equation(desired), tick.terms.mass_matrix).torque
        )
    )


@dataclass(frozen=True, eq=False)
class Limited:
    """Eq. (15) with contact forces that the ground can deliver; not in the paper.

    Attributes:
        limits: of the contact forces.
        length: m, lever arm that makes moments comparable to forces.
        base_priority: weight of base accelerations beside one for the joints.
    """

    limits: ContactLimits
    length: float
    base_priority: float

    @classmethod
    def of(
        cls, robot: Robot, friction: float = 0.7, base_priority: float = JOINTS_FIRST
    ) -> "Limited":
        """Friction cones of the given coefficient."""
        return cls(ContactLimits(friction), Stance.of(robot).radius, base_priority)

    def memory(self, num_robots: int) -> Memory:
        """The warm start of the contact forces."""
        return {"warm_start": np.zeros((num_robots, 6))}

    def __call__(self, tick: Tick, acceleration: np.ndarray, memory: Memory) -> np.ndarray:
        """See `Law`."""
        found = limited_inverse_dynamics(
            *tick.equation(acceleration),
            self.limits,
            point_map=tick.contacts.point_map,
            active=tick.active,
            base_priority=self.base_priority,
            length=self.length,
            warm_start=memory["warm_start"],
        )
        memory["warm_start"] = found.warm_start
        return found.torque


@dataclass(frozen=True, eq=False)
class MeasuredForce:
    """Eq. (8) with the forces that sensors at all contact points report; no contact is assumed.

    Attributes:
        geometry: of the contact points.
        sensor: noise, filter and delay of each force component.
        seed: of the noise.
    """

    geometry: ContactGeometry
    sensor: ForceSensor
    seed: int = 0

    @classmethod
    def of(
        cls, robot: Robot, noise: float = 0.0, cutoff_hz: float = np.inf, delay: int = 0
    ) -> "MeasuredForce":
        """Noise in N, filter in Hz, delay in control ticks."""
        sensor = ForceSensor(RATES.control, noise, cutoff_hz, delay)
        return cls(contact_geometry(robot), sensor)

    def memory(self, num_robots: int) -> Memory:
        """What the sensors remember."""
        start = self.sensor.start(np.zeros((num_robots, 3 * self.geometry.num_points)))
        return {"sensor": start, "noise": np.random.default_rng(self.seed)}

    def __call__(self, tick: Tick, acceleration: np.ndarray, memory: Memory) -> np.ndarray:
        """See `Law`."""
        force = tick.state.contact_force.reshape(len(acceleration), -1)
        force, memory["sensor"] = self.sensor.measure(force, memory["sensor"], memory["noise"])
        touching = reduced_contacts(self.geometry, tick.terms)
        return force_feedback_inverse_dynamics(
            *equation(tick.terms, touching, acceleration),
            np.matvec(touching.point_map, force),
        ).torque


@dataclass(frozen=True)
class EstimatedForce:
    """Eq. (8) with the forces that eq. (6) ascribes to all of the torque of the tick before."""

    def memory(self, num_robots: int) -> Memory:
        """Nothing of its own; the controller keeps what it "applied"."""
        return {}

    def __call__(self, tick: Tick, acceleration: np.ndarray, memory: Memory) -> np.ndarray:
        """See `Law`."""
        return estimated_force_inverse_dynamics(
            *tick.equation(acceleration), memory["applied"]
        ).torque


def rivals(robot: Robot) -> dict[str, Law]:
    """Return contact-force feedback as the paper compares with it, by name."""
    return {
        "measured force, ideal sensor": MeasuredForce.of(robot),
        "measured force, 10 ms late": MeasuredForce.of(robot, delay=5),
        "force from the previous torque": EstimatedForce(),
    }
