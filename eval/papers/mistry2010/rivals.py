"""[M10] III-A as feedforward laws: inverse dynamics that know the contact forces, eqs. (5)-(8)."""

from dataclasses import dataclass

import numpy as np

from eval.papers.trial import RATES, Memory
from fbid_gym.control import (
    ForceSensor,
    ForceSensorState,
    estimated_force_inverse_dynamics,
    force_feedback_inverse_dynamics,
    inertia_weighted_inverse_dynamics,
    metric_inverse_dynamics,
)
from fbid_gym.dynamics.contacts import ContactGeometry, ReducedContacts, reduced_contacts
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.robots import Robot


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
        cls,
        robot: Robot,
        noise: float = 0.0,
        cutoff_hz: float = np.inf,
        delay: int = 0,
        seed: int = 0,
    ) -> "MeasuredForce":
        """Noise in N, filter in Hz, delay in control ticks."""
        sensor = ForceSensor(RATES.control, noise, cutoff_hz, delay)
        return cls(ContactGeometry.of(robot), sensor, seed)

    def memory(self, num_robots: int) -> Memory:
        """What the sensors remember."""
        start = self.sensor.start(np.zeros((num_robots, 3 * self.geometry.num_points)))
        return {f"sensor.{k}": v for k, v in start._asdict().items()} | {
            "sensor.generator": np.random.default_rng(self.seed)
        }

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
        before = ForceSensorState(*(memory[f"sensor.{k}"] for k in ForceSensorState._fields))
        forces = state.contact_force.reshape(len(acceleration), -1)
        measured, after = self.sensor.measure(forces, before, memory["sensor.generator"])
        memory.update({f"sensor.{k}": v for k, v in after._asdict().items()})
        touching = reduced_contacts(self.geometry, terms)
        return np.asarray(
            force_feedback_inverse_dynamics(
                terms.mass_matrix,
                terms.bias,
                touching.jacobian,
                acceleration,
                touching.bias,
                np.matvec(touching.point_map, measured),
            ).torque
        )


@dataclass(frozen=True)
class EstimatedForce:
    """Eq. (8) with the forces that eq. (6) ascribes to the torque of the tick before.

    Attributes:
        of_total: whether that is all of the torque, feedback included, or the feedforward alone.
    """

    of_total: bool = True

    def memory(self, num_robots: int) -> Memory:
        """Nothing of its own; the controller keeps the torques."""
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
        previous = memory["applied" if self.of_total else "feedforward"]
        return np.asarray(
            estimated_force_inverse_dynamics(
                terms.mass_matrix,
                terms.bias,
                contacts.jacobian,
                acceleration,
                contacts.bias,
                previous,
            ).torque
        )


@dataclass(frozen=True)
class InertiaWeighted:
    """The least torques by the inertia-weighted projection of eq. (7)."""

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
            inertia_weighted_inverse_dynamics(
                terms.mass_matrix, terms.bias, contacts.jacobian, acceleration, contacts.bias
            ).torque
        )


@dataclass(frozen=True)
class InertiaMetric:
    """Eq. (15) decomposed in the metric of the kinetic energy: inertia chooses among torques."""

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
            metric_inverse_dynamics(
                terms.mass_matrix,
                terms.bias,
                contacts.jacobian,
                acceleration,
                contacts.bias,
                terms.mass_matrix,
            ).torque
        )
