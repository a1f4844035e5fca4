"""Layer `joint_acceleration`: the action is added to stabilising joint accelerations."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.acceleration_law import DIAGNOSTICS, AccelerationLaw
from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions
from fbid_gym.actions.layer import Memory
from fbid_gym.actions.options import positive
from fbid_gym.compiled import kernel
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot

_JOINTS_FIRST = 1e-3  # base priority: the base follows the joints


@dataclass(frozen=True, eq=False)
class JointAcceleration:
    """qdd = qdd_ref + w^2 (q_ref - q) + 2 zeta w (qdot_ref - qdot) + scale * action.

    Of the joints, through [M10] eq. (15). The base is not commanded: its acceleration is what the
    feet on the ground leave it.

    Attributes:
        law: from acceleration to torque.
        stiffness: w^2, 1/s^2.
        damping: 2 zeta w, 1/s.
        scale: rad/s^2 (m/s^2 for slides) at action 1.
    """

    law: AccelerationLaw
    stiffness: float
    damping: float
    scale: float

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        *,
        natural_frequency: float = 0.5,
        damping_ratio: float = 1.0,
        scale: float = 30.0,
        contact: ContactOptions = CONTACT_DEFAULTS,
    ) -> "JointAcceleration":
        """Build the layer.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            natural_frequency: w / (2 pi) in Hz of every joint's return to its reference.
            damping_ratio: zeta.
            scale: rad/s^2 (m/s^2 for slides) at action 1.
            contact: what it assumes of contacts.
        """
        positive(natural_frequency=natural_frequency, damping_ratio=damping_ratio, scale=scale)
        omega = 2.0 * np.pi * natural_frequency
        law = AccelerationLaw.of(robot, control_hz, contact, base_priority=_JOINTS_FIRST)
        return cls(law, omega**2, 2.0 * damping_ratio * omega, scale)

    @property
    def action_names(self) -> tuple[str, ...]:
        """One acceleration a joint."""
        joints = self.law.robot.joint_names
        return tuple(f"acceleration of {joint} (x {self.scale:g} rad/s^2)" for joint in joints)

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """Of the acceleration law."""
        return DIAGNOSTICS

    def memory(self, num_robots: int) -> Memory:
        """See `ActionLayer.memory`."""
        return self.law.memory(num_robots)

    def torque(
        self,
        action: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: Callable[[], DynamicsTerms],
        memory: Memory,
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        qpos, qvel = map(np.ascontiguousarray, state[:2])
        to_qpos, to_qvel, to_qacc = map(np.ascontiguousarray, reference[:3])
        acceleration = np.zeros(qvel.shape)
        _accelerate(
            *(action, self.scale, self.stiffness, self.damping),
            *(qpos, qvel, to_qpos, to_qvel, to_qacc, acceleration),
        )
        return self.law.torque(acceleration, state, reference, terms(), memory)


@kernel
def _accelerate(
    action: np.ndarray,
    scale: float,
    stiffness: float,
    damping: float,
    qpos: np.ndarray,
    qvel: np.ndarray,
    wanted_qpos: np.ndarray,
    wanted_qvel: np.ndarray,
    wanted_qacc: np.ndarray,
    result: np.ndarray,
) -> None:
    """Write the joints' part of result (N, nv); arguments of the layer, its state and reference."""
    for i in range(len(result)):
        row = min(i, len(wanted_qpos) - 1)
        for k in range(6, result.shape[1]):
            result[i, k] = (
                wanted_qacc[row, k]
                + stiffness * (wanted_qpos[row, k + 1] - qpos[i, k + 1])
                + damping * (wanted_qvel[row, k] - qvel[i, k])
                + scale * action[i, k - 6]
            )
