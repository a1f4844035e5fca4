"""Inverse dynamics of [M10] and its rivals: the torque for a desired acceleration."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from eval.papers.mistry2010.force_feedback import (
    Equation,
    estimated_force,
    force_feedback,
    inertia_weighted,
)
from eval.papers.mistry2010.force_sensor import ForceSensor
from eval.papers.mistry2010.metric import metric_inverse_dynamics
from eval.papers.trial import RATES, Memory
from fbid_gym.control import ContactLimits, limited_inverse_dynamics, orthogonal_inverse_dynamics
from fbid_gym.dynamics import DynamicsTerms, MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.quantities import ReducedContacts, RobotState, Target
from fbid_gym.robots import Robot

JOINTS_FIRST = 1e-3
"""Weight of base accelerations beside joint accelerations where the contacts do not allow both:
the reference's joint accelerations are kept, and the base follows."""


def equation(terms: DynamicsTerms, contacts: ReducedContacts, acceleration: np.ndarray) -> Equation:
    """Return the equation of motion of N robots that shall have accelerations (N, nv)."""
    return Equation(terms.mass_matrix, terms.bias, contacts.jacobian, acceleration, contacts.bias)


def posed(
    robot: Robot,
    qpos: np.ndarray,
    qvel: np.ndarray,
    acceleration: np.ndarray,
    active: np.ndarray | None = None,
) -> tuple[Equation, np.ndarray]:
    """Pose the equation of motion of a robot at N states.

    Args:
        robot: the robot.
        qpos: (N, nq) m, quaternion wxyz, rad.
        qvel: (N, nv) m/s, rad/s.
        acceleration: (N, nv) that it shall have.
        active: (N, P) bool, contact points; None for all.

    Returns:
        The equation, and the map (N, k, 3 P) from forces of the points to its rows of contacts.
    """
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    contacts = reduced_contacts(contact_geometry(robot), terms, active)
    return equation(terms, contacts, acceleration), contacts.point_map


def planned_points(robot: Robot, reference: Target) -> np.ndarray:
    """Return which contact points are planned to be down, (N, P) bool."""
    return reference.planted[:, contact_geometry(robot).foot_of_point]


class Tick(NamedTuple):
    """Inputs of a controller on one tick."""

    state: RobotState  # of the robots
    terms: DynamicsTerms  # their dynamics
    reference: Target  # that they shall follow
    active: np.ndarray  # (N, P) bool, the contact points that it counts on
    contacts: ReducedContacts  # of these points

    def equation(self, acceleration: np.ndarray) -> Equation:
        """Return the equation of motion for accelerations (N, nv)."""
        return equation(self.terms, self.contacts, acceleration)


class Law(NamedTuple):
    """Inverse dynamics."""

    torque: Callable[[Tick, np.ndarray, Memory], np.ndarray]
    """From a desired acceleration (N, nv) to torques (N, n) N·m; may remember in memory."""
    memory: Callable[[int], Memory] = lambda count: {}
    """What the law remembers of N robots that have not moved yet."""


def orthogonal(torque_cost: np.ndarray | None = None) -> Law:
    """[M10] eq. (15): contacts that pull and never slip.

    Args:
        torque_cost: (n,) diagonal of W of eq. (16); None for the identity.
    """

    def torque(tick: Tick, acceleration: np.ndarray, memory: Memory) -> np.ndarray:
        return orthogonal_inverse_dynamics(
            *tick.equation(acceleration), torque_cost=torque_cost, base_priority=JOINTS_FIRST
        ).torque

    return Law(torque)


WEIGHTED = Law(lambda tick, a, _: inertia_weighted(tick.equation(a)).torque)
"""The least torques by the inertia-weighted projection of eq. (7)."""

IN_METRIC = Law(
    lambda tick, a, _: metric_inverse_dynamics(tick.equation(a), tick.terms.mass_matrix).torque
)
"""Eq. (15) decomposed in the metric of the kinetic energy: inertia chooses among torques."""

ESTIMATED = Law(lambda tick, a, memory: estimated_force(tick.equation(a), memory["applied"]).torque)
"""Eq. (8) with the forces that eq. (6) ascribes to all of the torque of the tick before, which the
controller keeps in its memory as "applied"."""


def limited(robot: Robot, friction: float = 0.7, base_priority: float = JOINTS_FIRST) -> Law:
    """Eq. (15) with contact forces that the ground can deliver; not in the paper.

    Args:
        robot: whose feet.
        friction: of the cones.
        base_priority: weight of base accelerations beside one for the joints.
    """
    limits, length = ContactLimits(friction), Stance.of(robot).radius

    def torque(tick: Tick, acceleration: np.ndarray, memory: Memory) -> np.ndarray:
        found = limited_inverse_dynamics(
            *tick.equation(acceleration), limits, point_map=tick.contacts.point_map,
            active=tick.active, base_priority=base_priority, length=length,
            warm_start=memory["warm_start"],
        )  # fmt: skip
        memory["warm_start"] = found.warm_start
        return found.torque

    return Law(torque, lambda count: {"warm_start": np.zeros((count, 6))})


def measured(robot: Robot, noise: float = 0.0, cutoff_hz: float = np.inf, delay: int = 0) -> Law:
    """Eq. (8) with the forces that sensors at all contact points report; no contact is assumed.

    Args:
        robot: whose feet.
        noise: N.
        cutoff_hz: Hz, of the filter.
        delay: control ticks.
    """
    sensor, geometry = ForceSensor(RATES.control, noise, cutoff_hz, delay), contact_geometry(robot)

    def torque(tick: Tick, acceleration: np.ndarray, memory: Memory) -> np.ndarray:
        force = tick.state.contact_force.reshape(len(acceleration), -1)
        force, memory["sensor"] = sensor.measure(force, memory["sensor"], memory["noise"])
        touching = reduced_contacts(geometry, tick.terms)
        known = np.matvec(touching.point_map, force)
        return force_feedback(equation(tick.terms, touching, acceleration), known).torque

    return Law(torque, lambda count: {"sensor": None, "noise": np.random.default_rng(0)})


def rivals(robot: Robot) -> dict[str, Law]:
    """Return contact-force feedback as the paper compares with it, by name."""
    return {
        "measured force, ideal sensor": measured(robot),
        "measured force, 10 ms late": measured(robot, delay=5),
        "force from the previous torque": ESTIMATED,
    }
