"""Layer `joint_acceleration`: the action is added to stabilising joint accelerations."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.acceleration_law import AccelerationLaw
from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions
from fbid_gym.actions.falling import Falling, in_hertz
from fbid_gym.actions.ranges import AccelerationScale, DampingRatio, Frequency
from fbid_gym.compiled import bind, kernel
from fbid_gym.dynamics.stance import Stance
from fbid_gym.options import checked
from fbid_gym.quantities import DynamicsTerms, Memory, Reference, RobotState
from fbid_gym.robots import Robot

_JOINTS_FIRST = 1e-3  # base priority: the base follows the joints
_SCALE = 2.2


class _Gains(NamedTuple):
    """Of every joint.

    Attributes:
        stiffness: w^2, 1/s^2.
        damping: 2 zeta w, 1/s.
    """

    stiffness: float
    damping: float


@dataclass(frozen=True, eq=False)
class JointAcceleration:
    """qdd = qdd_ref + w^2 (q_ref - q) + 2 zeta w (qdot_ref - qdot) + scale * action.

    Of the joints, through [M10] eq. (15). The base is not commanded: its acceleration is what the
    feet on the ground leave it.

    Attributes:
        law: from acceleration to torque.
        gains: of the joints.
        scale: rad/s^2 (m/s^2 for slides) at action 1.
    """

    law: AccelerationLaw
    gains: _Gains
    scale: float

    @classmethod
    @checked
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        *,
        natural_frequency: Frequency = Falling(0.85),
        damping_ratio: DampingRatio = 1.0,
        scale: AccelerationScale | None = None,
        contact: ContactOptions = CONTACT_DEFAULTS,
    ) -> "JointAcceleration":
        """Build the layer.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            natural_frequency: w / (2 pi) in Hz of every joint's return to its reference.
            damping_ratio: zeta.
            scale: rad/s^2 (m/s^2 for slides) at action 1. Default: 2.2 times the square of the rate
                at which the robot falls, see `Falling`.
            contact: what it assumes of contacts.
        """
        (frequency,) = in_hertz(robot, natural_frequency=natural_frequency).values()
        if scale is None:
            scale = _SCALE * Stance.of(robot).falling_rate ** 2
        omega = 2.0 * np.pi * frequency
        law = AccelerationLaw.of(robot, control_hz, contact, base_priority=_JOINTS_FIRST)
        return cls(law, _Gains(omega**2, 2.0 * damping_ratio * omega), float(scale))

    @property
    def natural_frequency(self) -> float:
        """Hz, of every joint's return to its reference."""
        return float(np.sqrt(self.gains.stiffness)) / (2.0 * np.pi)

    @property
    def action_names(self) -> tuple[str, ...]:
        """One acceleration a joint."""
        joints = self.law.robot.joint_names
        return tuple(f"acceleration of {joint} (x {self.scale:g} rad/s^2)" for joint in joints)

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """Of the acceleration law."""
        return self.law.diagnostics

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
        desired = self._stabilise(action, state, reference)
        return self.law.torque(desired, state, reference, terms(), memory)

    @cached_property
    def _stabilise(self) -> Callable[..., np.ndarray]:
        return bind(_stabilise, self.gains, self.scale)


@kernel
def _stabilise(
    gains: _Gains, scale: float, action: np.ndarray, state: RobotState, reference: Reference
) -> np.ndarray:
    """Desired accelerations (N, nv) for actions (N, n) and their scale; zero for the base."""
    count, size = state.qvel.shape
    desired = np.zeros((count, size))
    for i in range(count):
        row = min(i, len(reference.qpos) - 1)
        for k in range(6, size):
            desired[i, k] = (
                reference.qacc[row, k]
                + gains.stiffness * (reference.qpos[row, k + 1] - state.qpos[i, k + 1])
                + gains.damping * (reference.qvel[row, k] - state.qvel[i, k])
                + scale * action[i, k - 6]
            )
    return desired
