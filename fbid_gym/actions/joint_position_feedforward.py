"""Layer `joint_position_feedforward`: a soft PD controller, and the motion's torque ahead of it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, NamedTuple

import numpy as np

from fbid_gym.actions.acceleration_law import (
    AccelerationLaw,
    LawConstants,
    torque_within_limits,
    torque_without_limits,
)
from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions
from fbid_gym.actions.contact_ramp import through_contact_switches
from fbid_gym.actions.falling import Falling, in_hertz
from fbid_gym.actions.joint_gains import JointGains
from fbid_gym.actions.law_memory import LawMemory
from fbid_gym.actions.ranges import DampingRatio, Frequency, Hertz, TargetScale
from fbid_gym.actions.smooth_target import Offset, SmoothTarget, TargetMemory, move_on, offset_of
from fbid_gym.compiled import bind, compiled, kernel
from fbid_gym.control.operational_space import LEAST_GAIN, serve_task
from fbid_gym.dynamics.contacts import reduce_contacts
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.support import support_frame
from fbid_gym.options import checked
from fbid_gym.quantities import (
    ActivePoints,
    Constraint,
    DynamicsTerms,
    Heading,
    Memory,
    ReducedContacts,
    Reference,
    RobotState,
    SupportFrame,
    TaskCommand,
    rows_of,
    some_of,
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
        least_gain: m, of it as a task that goes first, see `operational_space`.
        heading: of the feet.
    """

    stiffness: float
    damping: float
    least_gain: float
    heading: Heading


class _Constants(NamedTuple):
    """Of the layer on one robot, see `JointPositionFeedforward`."""

    law: LawConstants
    target: SmoothTarget
    gains: JointGains
    balance: _Balance


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
        target: of the offset; its scale in rad (m for slides).
        gains: K_P and K_D.
        balance: of the centre of mass.
    """

    law: AccelerationLaw
    target: SmoothTarget
    gains: JointGains
    balance: _Balance

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
        omega, stance = 2.0 * np.pi * balance, Stance.of(robot)
        least = LEAST_GAIN * stance.home_com[2]
        return cls(
            AccelerationLaw.of(robot, control_hz, contact, base_priority=_JOINTS_FIRST),
            SmoothTarget(scale, 2.0 * np.pi * target, 1.0 / control_hz),
            gains,
            _Balance(omega**2, 2.0 * omega, least, stance.heading),
        )

    @property
    def natural_frequency(self) -> float:
        """Hz, of the response that the gains give."""
        return self.gains.natural_frequency

    @property
    def action_names(self) -> tuple[str, ...]:
        """One target a joint."""
        return tuple(
            f"target of {joint} from its reference (x {self.target.scale:g} rad)"
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
        known, target, own = terms(), TargetMemory.of(memory), LawMemory.of(memory)
        active = self.law.belief(state, reference)
        torque = self._follow(active, action, target, state, reference, known, own)

        def of_contacts(rows: np.ndarray, active: ActivePoints) -> np.ndarray:
            return self._follow(
                active,
                action[rows],
                some_of(target, rows),
                some_of(state, rows),
                rows_of(reference, rows),
                some_of(known, rows),
                some_of(own, rows),
            )

        torque = through_contact_switches(self.law.ramp, active, torque, of_contacts, memory)
        self._move_on(action, target)
        return torque

    @cached_property
    def _follow(self) -> Callable[..., np.ndarray]:
        # Chosen here and not in compiled code: what a layer does not use is then not compiled.
        follow = _follow_within_limits if self.law.limited else _follow_without_limits
        return bind(follow, _Constants(self.law.constants, self.target, self.gains, self.balance))

    @cached_property
    def _move_on(self) -> Callable[..., None]:
        return bind(move_on, self.target)


@kernel
def _follow_within_limits(
    layer: _Constants,
    active: ActivePoints,
    action: np.ndarray,
    target: TargetMemory,
    state: RobotState,
    reference: Reference,
    terms: DynamicsTerms,
    memory: LawMemory,
) -> np.ndarray:
    """Torques (N, n) of eq. (18) for actions (N, n); updates the law's memory."""
    offset = offset_of(layer.target, action, target)
    contacts = reduce_contacts(layer.law.geometry, active, terms)
    desired = _desired_motion(layer, contacts, offset, reference, terms)
    torque = torque_within_limits(layer.law, active, contacts, terms, state, desired, memory)
    _add_feedback(layer.gains, state, reference, offset, torque)
    return torque


@kernel
def _follow_without_limits(
    layer: _Constants,
    active: ActivePoints,
    action: np.ndarray,
    target: TargetMemory,
    state: RobotState,
    reference: Reference,
    terms: DynamicsTerms,
    memory: LawMemory,
) -> np.ndarray:
    """The same where contact forces have no limits."""
    offset = offset_of(layer.target, action, target)
    contacts = reduce_contacts(layer.law.geometry, active, terms)
    desired = _desired_motion(layer, contacts, offset, reference, terms)
    torque = torque_without_limits(layer.law, contacts, terms, state, desired, memory)
    _add_feedback(layer.gains, state, reference, offset, torque)
    return torque


@compiled
def _desired_motion(
    layer: _Constants,
    contacts: ReducedContacts,
    offset: Offset,
    reference: Reference,
    terms: DynamicsTerms,
) -> np.ndarray:
    """qdd_d (N, nv) of eq. (18): balance first, by eq. (19), then the motion in what it leaves."""
    frame = support_frame(layer.balance.heading, terms)
    motion = _moving_along(frame, reference, offset)
    if layer.balance.stiffness == 0.0:
        return motion
    task = _balancing(layer.balance, frame, reference, terms)
    constraint = Constraint(contacts.jacobian, contacts.bias)
    least = np.full(2, layer.balance.least_gain)
    return serve_task(constraint, task, motion, layer.law.nearness.mobility, least).motion


@compiled
def _moving_along(frame: SupportFrame, reference: Reference, offset: Offset) -> np.ndarray:
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
    """What the centres of mass shall do in x and y, eq. (20)."""
    count, nv = terms.bias.shape
    jacobian, bias = np.empty((count, 2, nv)), np.empty((count, 2))
    acceleration = np.empty((count, 2))
    for i in range(count):
        row = min(i, len(reference.qacc) - 1)
        mass = terms.mass_matrix[i, 0, 0]
        for k in range(2):
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
def _add_feedback(
    gains: JointGains, state: RobotState, reference: Reference, offset: Offset, torque: np.ndarray
) -> None:
    """Add K_P (q_d - q) + K_D (qdot_d - qdot) of eq. (18) to torques (N, n) N·m."""
    count, joints = torque.shape
    for i in range(count):
        row = min(i, len(reference.qpos) - 1)
        for j in range(joints):
            error = reference.qpos[row, 7 + j] + offset.value[i, j] - state.qpos[i, 7 + j]
            rate = reference.qvel[row, 6 + j] + offset.rate[i, j] - state.qvel[i, 6 + j]
            torque[i, j] += gains.stiffness[j] * error + gains.damping[j] * rate
