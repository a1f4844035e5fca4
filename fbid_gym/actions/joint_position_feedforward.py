"""Layer `joint_position_feedforward`: a soft PD controller, and the motion's torque ahead of it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.acceleration_law import DIAGNOSTICS, AccelerationLaw, Task
from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions
from fbid_gym.actions.joint_gains import JointGains
from fbid_gym.actions.layer import Memory
from fbid_gym.actions.options import at_least_zero, positive
from fbid_gym.actions.smooth_target import SmoothTarget
from fbid_gym.compiled import kernel
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.support import Support, SupportFrame
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import dot

# Feedback need only be as stiff as falling is fast: the model carries the weight and the motion.
_STIFFER_THAN_FALLING = 1.0
_JOINTS_FIRST = 1e-3  # base priority: where the contacts do not allow both, the base follows


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
        support: the home stance.
        target: of the offset.
        stiffness: (n,) K_P, N·m/rad.
        damping: (n,) K_D, N·m·s/rad.
        natural_frequency: Hz, of the response that these gains give.
        balance_stiffness: w^2, 1/s^2; 0 for eq. (18) without balance.
        balance_damping: 2 w, 1/s.
        scale: rad (m for slides) at action 1.
    """

    law: AccelerationLaw
    support: Support
    target: SmoothTarget
    stiffness: np.ndarray
    damping: np.ndarray
    natural_frequency: float
    balance_stiffness: float
    balance_damping: float
    scale: float

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        *,
        natural_frequency: float | None = None,
        damping_ratio: float = 1.0,
        scale: float = 0.3,
        target_frequency: float = 2.0,
        balance_frequency: float = 1.0,
        contact: ContactOptions = CONTACT_DEFAULTS,
    ) -> "JointPositionFeedforward":
        """Build the layer.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            natural_frequency: Hz of the feedback, see `JointGains`. Default: that of the robot
                falling over, the pendulum frequency sqrt(g / height of the centre of mass) /
                (2 pi), or the largest that `control_hz` allows, if that is less.
            damping_ratio: of the feedback.
            scale: rad (m for slides) at action 1.
            target_frequency: Hz, at which the offset follows the action.
            balance_frequency: w / (2 pi) in Hz; 0 for eq. (18) without balance.
            contact: what it assumes of contacts.

        Raises:
            InvalidValueError: not positive, or so stiff that the sampled controller oscillates.
        """
        positive(scale=scale, target_frequency=target_frequency)
        at_least_zero(balance_frequency=balance_frequency)
        gains = JointGains.of(
            robot, control_hz, natural_frequency, damping_ratio, _STIFFER_THAN_FALLING
        )
        balance = 2.0 * np.pi * balance_frequency
        return cls(
            AccelerationLaw.of(robot, control_hz, contact, base_priority=_JOINTS_FIRST),
            Support.of(robot),
            SmoothTarget(2.0 * np.pi * target_frequency, 1.0 / control_hz),
            *gains,
            balance_stiffness=balance**2,
            balance_damping=2.0 * balance,
            scale=scale,
        )

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
        return DIAGNOSTICS

    def memory(self, num_robots: int) -> Memory:
        """Of the law and of the offset."""
        target = self.target.memory(num_robots, self.law.robot.num_joints)
        return self.law.memory(num_robots) | target

    def torque(
        self,
        action: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: Callable[[], DynamicsTerms],
        memory: Memory,
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        known, offset = terms(), self.target.step(self.scale * action, memory)
        frame = self.support.frame(known)
        qpos, qvel = map(np.ascontiguousarray, state[:2])
        to_qpos, to_qvel, to_qacc = map(np.ascontiguousarray, reference[:3])
        acceleration = np.empty(qvel.shape)
        _desire(to_qacc, offset.acceleration, frame.rotation, acceleration)
        balance = None
        if self.balance_stiffness > 0.0:
            balance = self._balance(reference, frame, known)
        model = self.law.torque(acceleration, state, reference, known, memory, balance)
        torque = np.empty(offset.value.shape)
        _add_feedback(
            *(model, self.stiffness, self.damping, qpos, qvel),
            *(to_qpos, to_qvel, offset.value, offset.rate, torque),
        )
        return torque

    def _balance(self, reference: Reference, frame: SupportFrame, terms: DynamicsTerms) -> Task:
        """What the centre of mass shall do in x and y, eq. (20)."""
        to_com, to_velocity, to_acceleration = map(np.ascontiguousarray, reference[3:6])
        count, nv = terms.bias.shape
        task = Task(np.empty((count, 2, nv)), np.empty((count, 2)), np.empty((count, 2)))
        _steer(
            *(to_com, to_velocity, to_acceleration),
            *frame,
            *(terms.mass_matrix, terms.bias, terms.com, terms.com_velocity),
            *(self.balance_stiffness, self.balance_damping),
            *task,
        )
        return task


@kernel
def _desire(
    wanted_qacc: np.ndarray, offset: np.ndarray, heading: np.ndarray, result: np.ndarray
) -> None:
    """Write the desired accelerations to result (N, nv).

    Args:
        wanted_qacc: (N, nv) or (1, nv), of the reference.
        offset: (N, n), to be added to the joints'.
        heading: (N, 3, 3) world from support frame.
        result: m/s^2 and rad/s^2.
    """
    for i in range(len(result)):
        row = min(i, len(wanted_qacc) - 1)
        for k in range(3):
            result[i, k] = dot(heading[i, k], wanted_qacc[row, :3])
            result[i, k + 3] = wanted_qacc[row, k + 3]
        for j in range(offset.shape[1]):
            result[i, 6 + j] = wanted_qacc[row, 6 + j] + offset[i, j]


@kernel
def _steer(
    wanted_com: np.ndarray,
    wanted_velocity: np.ndarray,
    wanted_acceleration: np.ndarray,
    centre: np.ndarray,
    heading: np.ndarray,
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    com: np.ndarray,
    com_velocity: np.ndarray,
    stiffness: float,
    damping: float,
    jacobian: np.ndarray,
    jacobian_bias: np.ndarray,
    acceleration: np.ndarray,
) -> None:
    """Write the `Task` of the centres of mass to the last three arguments.

    The others are those of `Reference` (N rows or one), `SupportFrame`, `DynamicsTerms`, and the
    gains.
    """
    for i in range(len(com)):
        row = min(i, len(wanted_com) - 1)
        mass = mass_matrix[i, 0, 0]
        for k in range(2):
            for j in range(jacobian.shape[2]):
                jacobian[i, k, j] = mass_matrix[i, k, j] / mass
            jacobian_bias[i, k] = bias[i, k] / mass
            axis = heading[i, k]
            place = dot(axis, wanted_com[row]) - (com[i, k] - centre[i, k])
            rate = dot(axis, wanted_velocity[row]) - com_velocity[i, k]
            acceleration[i, k] = dot(axis, wanted_acceleration[row])
            acceleration[i, k] += stiffness * place + damping * rate


@kernel
def _add_feedback(
    model: np.ndarray,
    stiffness: np.ndarray,
    damping: np.ndarray,
    qpos: np.ndarray,
    qvel: np.ndarray,
    wanted_qpos: np.ndarray,
    wanted_qvel: np.ndarray,
    offset: np.ndarray,
    offset_rate: np.ndarray,
    torque: np.ndarray,
) -> None:
    """Write torque (N, n): that of the model and that of the feedback, eq. (18)."""
    for i in range(len(torque)):
        row = min(i, len(wanted_qpos) - 1)
        for j in range(len(stiffness)):
            error = wanted_qpos[row, 7 + j] + offset[i, j] - qpos[i, 7 + j]
            rate = wanted_qvel[row, 6 + j] + offset_rate[i, j] - qvel[i, 6 + j]
            torque[i, j] = model[i, j] + stiffness[j] * error + damping[j] * rate
