"""From a desired wrench at the centre of mass to joint torques, while some feet may swing."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.contact_belief import ContactBelief
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.contact_ramp import ContactRamp
from fbid_gym.actions.layer import Memory
from fbid_gym.compiled import kernel
from fbid_gym.control import (
    Balance,
    ContactLimits,
    TorqueMap,
    distribute,
    distribute_freely,
    underactuation,
)
from fbid_gym.control.contact_forces import all_active
from fbid_gym.dynamics import CentroidalTerms, MuJoCoDynamics
from fbid_gym.dynamics.contacts import ContactGeometry, reduced_contacts
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.support import Support
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot

# A swinging leg follows its own command; the other joints make up for what that does to contacts
# and momentum.
_SWING_MOBILITY = 1e-3


class JointGains(NamedTuple):
    """Of the joints: w^2 (1/s^2) and 2 zeta w (1/s), while their foot stands and while it swings.

    Attributes:
        stiffness: of joints that no swinging foot hangs from.
        damping: of the same.
        swing_stiffness: of a swinging leg.
        swing_damping: of the same.
    """

    stiffness: float
    damping: float
    swing_stiffness: float
    swing_damping: float

    @classmethod
    def of(cls, posture: float, swing: float, ratio: float) -> "JointGains":
        """From natural frequencies in Hz and a damping ratio."""
        rates = 2.0 * np.pi * posture, 2.0 * np.pi * swing
        return cls(rates[0] ** 2, 2.0 * ratio * rates[0], rates[1] ** 2, 2.0 * ratio * rates[1])


@dataclass(frozen=True, eq=False)
class BalanceLaw:
    """A balancer on a robot's feet; F feet, P points.

    Attributes:
        robot: whose joints.
        torque_map: of the balancer, see `fbid_gym.control.balancers`.
        gains: of the joints.
        geometry: of the contact points.
        belief: which points are taken to be in contact.
        limits: on their forces; None for contacts that pull and never slip.
        ramp: leads from one set of contacts to the next; None where the torque may jump.
        damping: (n,) N·m·s/rad of the joints, to be compensated; zero for none.
        weight: N, of the robot.
        length: m, lever arm that makes moments comparable to forces.
        wrench_cost: weights of the squared errors of force and moment where not both can be had.
        legs: (F, n) joints that move this foot and no other, 0 or 1.
    """

    robot: Robot
    torque_map: Callable[..., TorqueMap]
    gains: JointGains
    geometry: ContactGeometry
    belief: ContactBelief
    limits: ContactLimits | None
    ramp: ContactRamp | None
    damping: np.ndarray
    weight: float
    length: float
    wrench_cost: tuple[float, ...]
    legs: np.ndarray

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        contact: ContactOptions,
        torque_map: Callable[..., TorqueMap],
        gains: JointGains,
        moment_priority: float,
    ) -> "BalanceLaw":
        """Build the law on what `contact` says of the contacts."""
        geometry = ContactGeometry.of(robot)
        terms = MuJoCoDynamics(robot).terms(robot.home_qpos[None], np.zeros((1, robot.nv)))
        moves = np.abs(terms.foot_jacobian[0, :, :, 6:]).max(axis=1) > 0.0
        return cls(
            robot=robot,
            torque_map=torque_map,
            gains=gains,
            geometry=geometry,
            belief=contact.belief(robot, control_hz),
            limits=contact.limits(robot),
            ramp=contact.ramp(control_hz),
            damping=contact.damping(robot),
            weight=robot.weight,
            length=Support.of(robot).radius or 1.0,
            wrench_cost=(1.0,) * 3 + (moment_priority,) * 3,
            legs=(moves & (moves.sum(axis=0) == 1)).astype(float),
        )

    def memory(self, num_robots: int) -> Memory:
        """Warm start of the contact forces, the diagnostics, and a ramp's state."""
        memory = {
            "warm_start": np.zeros((num_robots, 6)),
            "residual": np.zeros(num_robots),
            "underactuation": np.zeros(num_robots),
        }
        if self.ramp is not None:
            memory |= self.ramp.memory(num_robots, self.robot.num_points, self.robot.num_joints)
        return memory

    def torque(
        self,
        wrench: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: DynamicsTerms,
        body: CentroidalTerms,
        memory: Memory,
    ) -> np.ndarray:
        """Return joint torques.

        Args:
            wrench: (N, 6) N and N·m, world, desired at the centre of mass.
            state: of the robots.
            reference: which plans contacts and joints.
            terms: of the robots.
            body: of the robots.
            memory: of the robots; updated.

        Returns:
            (N, n) N·m.
        """
        active, warm_start = self.belief(state, reference), memory["warm_start"]
        posture, mobility = self._posture(state, reference, active)
        balance, missing = self._solve(wrench, posture, mobility, terms, body, active, warm_start)
        memory["warm_start"], memory["residual"] = balance.warm_start, balance.residual
        if missing is not None:
            memory["underactuation"] = missing
        torque = balance.torque
        if self.ramp is not None and active is not None:

            def of_contacts(rows: np.ndarray, contacts: np.ndarray) -> np.ndarray:
                before = active.copy()
                before[rows] = contacts
                posture, mobility = self._posture(state, reference, before)
                return self._solve(
                    wrench[rows],
                    posture[rows],
                    mobility[rows],
                    DynamicsTerms(*(value[rows] for value in terms)),
                    CentroidalTerms(*(value[rows] for value in body)),
                    contacts,
                    warm_start[rows],
                )[0].torque

            torque = self.ramp.torque(torque, active, of_contacts, memory)
        _add_damping(self.damping, np.ascontiguousarray(state.qvel), torque)
        return torque

    def _solve(
        self,
        wrench: np.ndarray,
        posture: np.ndarray,
        mobility: np.ndarray,
        terms: DynamicsTerms,
        body: CentroidalTerms,
        active: np.ndarray | None,
        warm_start: np.ndarray,
    ) -> tuple[Balance, np.ndarray | None]:
        """The balance with one set of contacts, and in how many directions it cannot be pushed."""
        contacts = reduced_contacts(self.geometry, terms, active)
        torque_map = self.torque_map(terms, body, contacts, posture, mobility)
        maps = {"to_com": body.to_com, "point_map": contacts.point_map}
        weight, length = self.weight, self.length
        if self.limits is None:
            balance = distribute_freely(torque_map, wrench, weight=weight, length=length, **maps)
        else:
            balance = distribute(
                torque_map,
                wrench,
                self.limits,
                torque_limit=self.robot.torque_limit,
                active=active,
                weight=weight,
                length=length,
                wrench_cost=self.wrench_cost,
                warm_start=warm_start,
                **maps,
            )
        if active is None:
            return balance, None
        return balance, underactuation(contacts.jacobian)

    def _posture(
        self, state: RobotState, reference: Reference, active: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Desired joint accelerations, and the mobility of joints: (N, n) each."""
        shape = len(state.qpos), len(self.damping)
        posture, mobility = np.empty(shape), np.empty(shape)
        _fill_posture(
            np.ascontiguousarray(state.qpos),
            np.ascontiguousarray(state.qvel),
            np.ascontiguousarray(reference.qpos),
            np.ascontiguousarray(reference.qvel),
            np.ascontiguousarray(reference.qacc),
            all_active(self.geometry.num_points)
            if active is None
            else np.ascontiguousarray(active),
            self.geometry.foot_of_point,
            self.legs,
            *self.gains,
            posture,
            mobility,
        )
        return posture, mobility


@kernel
def _fill_posture(
    position: np.ndarray,
    velocity: np.ndarray,
    wanted_position: np.ndarray,
    wanted_velocity: np.ndarray,
    wanted_acceleration: np.ndarray,
    active: np.ndarray,
    foot_of_point: np.ndarray,
    legs: np.ndarray,
    stiffness: float,
    damping: float,
    swing_stiffness: float,
    swing_damping: float,
    posture: np.ndarray,
    mobility: np.ndarray,
) -> None:
    """See `BalanceLaw._posture`; "wanted" and "active" rows are one for each or one for all."""
    in_the_air = np.empty(len(legs), np.bool_)
    for i in range(len(posture)):
        row, contacts = min(i, len(wanted_position) - 1), active[min(i, len(active) - 1)]
        in_the_air[:] = True
        for point in range(len(contacts)):
            if contacts[point]:
                in_the_air[foot_of_point[point]] = False
        for j in range(posture.shape[1]):
            error = wanted_position[row, 7 + j] - position[i, 7 + j]
            rate = wanted_velocity[row, 6 + j] - velocity[i, 6 + j]
            swings = False
            for foot in range(len(legs)):
                swings |= in_the_air[foot] and legs[foot, j] > 0.0
            pull = swing_stiffness * error + swing_damping * rate
            if not swings:
                pull = stiffness * error + damping * rate
            posture[i, j] = wanted_acceleration[row, 6 + j] + pull
            mobility[i, j] = _SWING_MOBILITY if swings else 1.0


@kernel
def _add_damping(damping: np.ndarray, velocity: np.ndarray, torque: np.ndarray) -> None:
    """Add to the torques (N, n) what the joints' damping takes away."""
    for i in range(len(torque)):
        for j in range(len(damping)):
            torque[i, j] += damping[j] * velocity[i, 6 + j]
