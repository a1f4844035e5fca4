"""Layer `joint_acceleration`: the action is added to stabilising joint accelerations."""

from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions
from fbid_gym.actions.gains import default_gains, in_hz
from fbid_gym.actions.joint_motion import JointMotion
from fbid_gym.actions.law import BodyLaw, LawLayer
from fbid_gym.actions.layer import GetTerms
from fbid_gym.actions.ranges import AccelerationScale, DampingRatio, Frequency, in_hertz
from fbid_gym.compiled import kernel
from fbid_gym.control.body_law import Command
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import checked
from fbid_gym.quantities import Memory, RobotState, Target
from fbid_gym.robots import Robot

_SCALE = 2.2
_PLANNED = 0.85  # times the rate at which the robot falls


@dataclass(frozen=True, eq=False)
class JointAcceleration(LawLayer):
    """qdd = qdd_t + w^2 (q_t - q) + 2 zeta w (qdot_t - qdot) + scale * action.

    Of the joints, towards their target q_t, through [M10] eq. (15). The base is not commanded: its
    acceleration is what the feet on the ground leave it.
    """

    law: BodyLaw  # from acceleration to torque
    motion: JointMotion  # of the joints that are followed
    stiffness: float  # w^2, 1/s^2, of every joint
    damping: float  # 2 zeta w, 1/s, of every joint
    scale: float  # rad/s^2 (m/s^2 for slides) at action 1
    contact: ContactOptions  # what it assumes of contacts

    @classmethod
    @checked
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        kind: MotionKind,
        *,
        natural_frequency: Frequency | None = None,
        damping_ratio: DampingRatio = 1.0,
        scale: AccelerationScale | None = None,
        contact: ContactOptions = CONTACT_DEFAULTS,
    ) -> "JointAcceleration":
        """Build the layer.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            kind: of motion.
            natural_frequency: w / (2 pi) in Hz of every joint's return to its target. Default: 0.85
                times that at which the robot falls; on a gait that of its feet in the air.
            damping_ratio: zeta.
            scale: rad/s^2 (m/s^2 for slides) at action 1. Default: 2.2 times the square of the rate
                at which the robot falls, see `Falling`.
            contact: what it assumes of contacts.
        """
        gains = default_gains(robot, kind)
        hertz = in_hertz(robot, natural_frequency)
        omega = 2.0 * np.pi * hertz if hertz is not None else _PLANNED * kind.omega
        if hertz is None and kind.gait:
            omega = np.sqrt(gains.swing)
        if scale is None:
            scale = _SCALE * Stance.of(robot).falling_rate ** 2
        assumed, firm = contact.on(robot, kind), gains._replace(hold=0.0)
        law = BodyLaw.of(robot, control_hz, assumed, firm, 1.0, joints_first=True)
        motion = JointMotion.of(robot, kind, gains, aware=True)
        damping = 2.0 * damping_ratio * float(omega)
        return cls(law, motion, float(omega) ** 2, damping, float(scale), assumed)

    @property
    def natural_frequency(self) -> float:
        """Hz, of every joint's return to its target."""
        return in_hz(self.stiffness)

    @property
    def action_names(self) -> tuple[str, ...]:
        """One acceleration a joint."""
        joints = self.law.robot.joint_names
        return tuple(f"acceleration of {joint} (x {self.scale:g} rad/s^2)" for joint in joints)

    def torque(
        self, action: np.ndarray, state: RobotState, target: Target, terms: GetTerms, memory: Memory
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        known = terms()
        followed = self.motion.target(state, target, known)
        gains = self.stiffness, self.damping, self.scale
        command = _accelerate(*gains, action, state, followed)
        return self.law.torque(command, state, target, known, memory)


@kernel
def _accelerate(
    stiffness: float,
    damping: float,
    scale: float,
    action: np.ndarray,
    state: RobotState,
    target: Target,
) -> Command:
    """Desired accelerations of the joints for actions (N, n) and their scale; none of the base."""
    count, size = state.qvel.shape
    desired = np.zeros((count, size))
    for i in range(count):
        for k in range(6, size):
            desired[i, k] = (
                target.qacc[i, k]
                + stiffness * (target.qpos[i, k + 1] - state.qpos[i, k + 1])
                + damping * (target.qvel[i, k] - state.qvel[i, k])
                + scale * action[i, k - 6]
            )
    return Command(desired, np.empty((count, 0)), np.empty((0, 6)))
