"""Layer `joint_position_feedforward`: a soft PD controller, and the motion's torque ahead of it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from fbid_gym.actions.acceleration_law import AccelerationLaw
from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions
from fbid_gym.actions.falling import Falling, in_hertz
from fbid_gym.actions.joint_gains import JointGains
from fbid_gym.actions.ranges import DampingRatio, Frequency, Hertz, TargetScale
from fbid_gym.actions.smooth_target import Offset, SmoothTarget, TargetMemory, follow
from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.support import support_frame
from fbid_gym.options import checked
from fbid_gym.quantities import (
    DynamicsTerms,
    Heading,
    Memory,
    Reference,
    RobotState,
    SupportFrame,
    TaskCommand,
)
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import dot

# Feedback need only be as stiff as falling is fast: the model carries the weight and the motion.
_JOINTS_FIRST = 1e-3  # base priority: where the contacts do not allow both, the base follows


class _Balance(NamedTuple):
    """Of the centre of mass above the feet.

    Attributes:
        stiffness: w^2, 1/s^2; 0 for eq. (18) without balance.
        damping: 2 w, 1/s.
        heading: of the feet.
    """

    stiffness: float
    damping: float
    heading: Heading


@dataclass(frozen=True, eq=False)
class JointPositionFeedforward:
    """tau = InvDyn(q, qdot, qdd_d) + K_P (q_d - q) + K_D (qdot_d - qdot), [M10] eq. (18).

    The desired motion of the joints is that of the reference and, added to it, an offset x that
    follows scale * action as a critically damped second-order system does; so it has the rate and
    the acceleration that eq. (18) asks for. That of the base is the reference's.

    In qdd_d balance comes first and the desired motion acts in what it leaves, which is eq. (19).
    The balance is eq. (20): the centre of mass returns, in x and y, to the reference's above the
    feet,

        xdd_d = xdd_ref + w^2 (x_ref - x) + 2 w (xdot_ref - xdot).

    The paper lets the base's Jacobian stand for that of the centre of mass, which is here its own:
    the base's rows of M over the mass. InvDyn is eq. (15), by default with limits on the contact
    forces; the feedback is not limited, one more reason for it to be soft.

    Attributes:
        law: InvDyn.
        target: of the offset.
        gains: K_P and K_D.
        balance: of the centre of mass.
        scale: rad (m for slides) at action 1.
    """

    law: AccelerationLaw
    target: SmoothTarget
    gains: JointGains
    balance: _Balance
    scale: float

    @classmethod
    @checked
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        *,
        natural_frequency: Frequency = Falling(1.0),
        damping_ratio: DampingRatio = 1.0,
        scale: TargetScale = 0.3,
        target_frequency: Frequency = Falling(3.4),
        balance_frequency: Annotated[float | Falling, Hertz(least=0.0)] = Falling(1.7),
        contact: ContactOptions = CONTACT_DEFAULTS,
    ) -> "JointPositionFeedforward":
        """Build the layer.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            natural_frequency: Hz of the feedback, see `JointGains`.
            damping_ratio: of the feedback.
            scale: rad (m for slides) at action 1.
            target_frequency: Hz, at which the offset follows the action.
            balance_frequency: w / (2 pi) in Hz; 0 for eq. (18) without balance.
            contact: what it assumes of contacts.

        Raises:
            InvalidValueError: out of range, or beyond what any joint can be held with.
        """
        (target,) = in_hertz(robot, target_frequency=target_frequency).values()
        (balance,) = in_hertz(robot, balance_frequency=balance_frequency).values()
        gains = JointGains.of(robot, control_hz, natural_frequency, damping_ratio)
        omega = 2.0 * np.pi * balance
        return cls(
            AccelerationLaw.of(robot, control_hz, contact, base_priority=_JOINTS_FIRST),
            SmoothTarget(2.0 * np.pi * target, 1.0 / control_hz),
            gains,
            _Balance(omega**2, 2.0 * omega, Stance.of(robot).heading),
            scale,
        )

    @property
    def natural_frequency(self) -> float:
        """Hz, of the response that the gains give."""
        return self.gains.natural_frequency

    @property
    def action_names(self) -> tuple[str, ...]:
        """One target a joint."""
        return tuple(
            f"target of {joint} from its reference (x {self.scale:g} rad)"
            for joint in self.law.robot.joint_names
        )

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """Of the acceleration law."""
        return self.law.diagnostics

    def memory(self, num_robots: int) -> Memory:
        """Of the law and of the offset."""
        target = TargetMemory.fresh(num_robots, self.law.robot.num_joints)
        return self.law.memory(num_robots) | target._asdict()

    def torque(
        self,
        action: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: Callable[[], DynamicsTerms],
        memory: Memory,
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        known, goal, target = terms(), self.scale * action, TargetMemory.of(memory)
        robots = state, reference, known
        wanted = _ask(self.balance, self.gains, self.target, goal, target, *robots)
        model = self.law.torque(wanted.motion, *robots, memory, wanted.balance)
        return model + wanted.feedback


class _Asked(NamedTuple):
    """What eq. (18) asks of InvDyn, and what it adds to that.

    Attributes:
        motion: (N, nv) qdd_d, before balance.
        balance: of eq. (19); no rows for none.
        feedback: (N, n) N·m.
    """

    motion: np.ndarray
    balance: TaskCommand
    feedback: np.ndarray


@kernel
def _ask(
    balance: _Balance,
    gains: JointGains,
    smooth: SmoothTarget,
    goal: np.ndarray,
    memory: TargetMemory,
    state: RobotState,
    reference: Reference,
    terms: DynamicsTerms,
) -> _Asked:
    """The tick's terms of eq. (18), in one call; goals (N, n); updates the memory."""
    offset, frame = follow(smooth, goal, memory), support_frame(balance.heading, terms)
    return _Asked(
        _desired_motion(frame, reference, offset),
        _balancing(balance, frame, reference, terms),
        _feedback(gains, state, reference, offset),
    )


@compiled
def _desired_motion(frame: SupportFrame, reference: Reference, offset: Offset) -> np.ndarray:
    """The reference's accelerations and the offset's: (N, nv), the base's linear ones in world."""
    count, joints = offset.value.shape
    desired = np.empty((count, 6 + joints))
    for i in range(count):
        row = min(i, len(reference.qacc) - 1)
        for k in range(3):
            desired[i, k] = dot(frame.world_from_support[i, k], reference.qacc[row, :3])
            desired[i, k + 3] = reference.qacc[row, k + 3]
        for j in range(joints):
            desired[i, 6 + j] = reference.qacc[row, 6 + j] + offset.acceleration[i, j]
    return desired


@compiled
def _balancing(
    balance: _Balance, frame: SupportFrame, reference: Reference, terms: DynamicsTerms
) -> TaskCommand:
    """What the centres of mass shall do in x and y, eq. (20); no rows without stiffness."""
    count, nv = terms.bias.shape
    rows = 2 if balance.stiffness > 0.0 else 0
    jacobian, bias = np.empty((count, rows, nv)), np.empty((count, rows))
    acceleration = np.empty((count, rows))
    for i in range(count):
        row = min(i, len(reference.qacc) - 1)
        mass = terms.mass_matrix[i, 0, 0]
        for k in range(rows):
            for j in range(nv):
                jacobian[i, k, j] = terms.mass_matrix[i, k, j] / mass
            bias[i, k] = terms.bias[i, k] / mass
            axis = frame.world_from_support[i, k]
            place = dot(axis, reference.com_in_support[row]) - (
                terms.com[i, k] - frame.centre[i, k]
            )
            rate = dot(axis, reference.com_velocity_in_support[row]) - terms.com_velocity[i, k]
            acceleration[i, k] = dot(axis, reference.com_acceleration_in_support[row])
            acceleration[i, k] += balance.stiffness * place + balance.damping * rate
    return TaskCommand(jacobian, bias, acceleration)


@compiled
def _feedback(
    gains: JointGains, state: RobotState, reference: Reference, offset: Offset
) -> np.ndarray:
    """K_P (q_d - q) + K_D (qdot_d - qdot) of eq. (18): (N, n) N·m."""
    count, joints = offset.value.shape
    torque = np.empty((count, joints))
    for i in range(count):
        row = min(i, len(reference.qpos) - 1)
        for j in range(joints):
            error = reference.qpos[row, 7 + j] + offset.value[i, j] - state.qpos[i, 7 + j]
            rate = reference.qvel[row, 6 + j] + offset.rate[i, j] - state.qvel[i, 6 + j]
            torque[i, j] = gains.stiffness[j] * error + gains.damping[j] * rate
    return torque
