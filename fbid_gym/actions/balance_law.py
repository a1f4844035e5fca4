"""From a desired wrench at the centre of mass to joint torques, while some feet may swing."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.balance_tick import balance_tick
from fbid_gym.actions.contact_belief import ContactBelief
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.contact_ramp import ContactRamp
from fbid_gym.actions.desired_wrench import Feedback
from fbid_gym.actions.layer import Memory
from fbid_gym.control import ContactLimits
from fbid_gym.control.arrays import as_flags
from fbid_gym.control.contact_forces import limit_rows, wrench_scale
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import ContactGeometry
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.support import Support
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot


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
        balancer: one of those in `fbid_gym.control.balancers`.
        gains: of the joints.
        geometry: of the contact points.
        support: the home stance.
        belief: which points are taken to be in contact.
        limited: whether contact forces and torques have limits; contacts without can pull and never
            slip.
        limits: (1, P, 3) on the contact forces, see `limit_rows`.
        torque_limit: (1, n) N·m.
        ramp: leads from one set of contacts to the next; None where the torque may jump.
        damping: (n,) N·m·s/rad of the joints, to be compensated; zero for none.
        gravity: m/s².
        weight: (1,) N, of the robot.
        scale: (6,) turns errors of the wrench into N whose squares are comparable.
        legs: (F, n) joints that move this foot and no other, 0 or 1.
    """

    balancer: int
    gains: JointGains
    geometry: ContactGeometry
    support: Support
    belief: ContactBelief
    limited: bool
    limits: np.ndarray
    torque_limit: np.ndarray
    ramp: ContactRamp | None
    damping: np.ndarray
    gravity: float
    weight: np.ndarray
    scale: np.ndarray
    legs: np.ndarray

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        contact: ContactOptions,
        balancer: int,
        gains: JointGains,
        moment_priority: float,
    ) -> "BalanceLaw":
        """Build the law on what `contact` says of the contacts."""
        geometry, support, limits = (
            ContactGeometry.of(robot),
            Support.of(robot),
            contact.limits(robot),
        )
        terms = MuJoCoDynamics(robot).terms(robot.home_qpos[None], np.zeros((1, robot.nv)))
        moves = np.abs(terms.foot_jacobian[0, :, :, 6:]).max(axis=1) > 0.0
        length, cost = support.radius or 1.0, (1.0,) * 3 + (moment_priority,) * 3
        return cls(
            balancer=balancer,
            gains=gains,
            geometry=geometry,
            support=support,
            belief=contact.belief(robot, control_hz),
            limited=limits is not None,
            limits=limit_rows(limits or ContactLimits(), robot.num_points),
            torque_limit=robot.torque_limit[None].copy(),
            ramp=contact.ramp(control_hz),
            damping=contact.damping(robot),
            gravity=robot.weight / robot.mass,
            weight=np.array([robot.weight]),
            scale=wrench_scale(length, cost if limits is not None else None),
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
            memory |= self.ramp.memory(num_robots, self.geometry.num_points, len(self.damping))
        return memory

    def torque(
        self,
        push: np.ndarray,
        feedback: Feedback,
        state: RobotState,
        reference: Reference,
        terms: DynamicsTerms,
        memory: Memory,
    ) -> np.ndarray:
        """Return joint torques.

        Args:
            push: (N, 6) N and N·m, added to the desired wrench in the frame of the feet.
            feedback: what else the wrench is made of.
            state: of the robots.
            reference: what they shall do.
            terms: of the robots.
            memory: of the robots; updated.

        Returns:
            (N, n) N·m.
        """
        active, start = self.belief(state, reference), memory["warm_start"]
        torque, found = self._solve(feedback, push, state, reference, terms, start, active)
        memory.update(found)
        if self.ramp is None or active is None:
            return torque

        def of_contacts(rows: np.ndarray, contacts: np.ndarray) -> np.ndarray:
            return self._solve(
                feedback,
                push[rows],
                RobotState(*(value[rows] for value in state)),
                _rows_of(reference, rows),
                DynamicsTerms(*(value[rows] for value in terms)),
                start[rows],
                contacts,
            )[0]

        return self.ramp.torque(torque, active, of_contacts, memory)

    def _solve(
        self,
        feedback: Feedback,
        push: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: DynamicsTerms,
        start: np.ndarray,
        active: np.ndarray | None,
    ) -> tuple[np.ndarray, Memory]:
        """Torques (N, n) with one set of contacts, and what goes into the memory."""
        support, geometry, count = self.support, self.geometry, len(push)
        torque, residual = np.empty((count, len(self.damping))), np.empty(count)
        warm_start, missing = np.empty((count, 6)), np.empty(count)
        balance_tick(
            *feedback,
            self.gravity,
            np.ascontiguousarray(push),
            np.ascontiguousarray(state.qpos),
            np.ascontiguousarray(state.qvel),
            np.ascontiguousarray(reference.qpos),
            np.ascontiguousarray(reference.qvel),
            np.ascontiguousarray(reference.qacc),
            np.ascontiguousarray(reference.com),
            np.ascontiguousarray(reference.com_velocity),
            np.ascontiguousarray(reference.com_acceleration),
            terms.mass_matrix,
            terms.bias,
            terms.base_position,
            terms.base_rotation,
            terms.com,
            terms.com_velocity,
            terms.foot_position,
            terms.foot_rotation,
            terms.foot_velocity,
            terms.foot_jacobian,
            terms.foot_bias,
            support.centre,
            support.by_position,
            support.by_rotation,
            geometry.foot_of_point,
            geometry.slot_of_point,
            geometry.offset,
            geometry.motion,
            geometry.spread,
            active is not None,
            geometry.every if active is None else as_flags(active),
            self.legs,
            *self.gains,
            self.balancer,
            self.limited,
            self.limits,
            self.torque_limit,
            self.weight,
            self.scale,
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


def _rows_of(reference: Reference, rows: np.ndarray) -> Reference:
    """The reference of some robots; a single row goes on to stand for all."""
    parts = reference._asdict().items()
    return reference._replace(
        **{name: part[rows] for name, part in parts if part is not None and len(part) > 1}
    )
