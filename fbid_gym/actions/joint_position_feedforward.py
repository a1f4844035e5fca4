"""Layer `joint_position_feedforward`: a soft PD controller, and the motion's torque ahead of it."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions
from fbid_gym.actions.gains import BodyOptions, in_hz
from fbid_gym.actions.joint_gains import JointGains, at_joints, closed_in_drives, feedback
from fbid_gym.actions.joint_motion import JointMotion, JointTarget
from fbid_gym.actions.law import BodyLaw, LawLayer
from fbid_gym.actions.layer import GetTerms
from fbid_gym.actions.ranges import (
    DampingRatio,
    Falling,
    Frequency,
    Hertz,
    LoopDelay,
    TargetScale,
    in_hertz,
)
from fbid_gym.compiled import kernel
from fbid_gym.control.body_law import Command
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import checked
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target
from fbid_gym.robots import Robot


class SmoothTarget(NamedTuple):
    """Critically damped second-order response to u = scale * action, held for a control tick.

    xdd = w^2 (u - x) - 2 w xdot, solved exactly: with e = x - u and c = xdot + w e at a tick, the
    time t later x = u + (e + c t) exp(-w t) and xdot = (xdot - w c t) exp(-w t).
    """

    scale: float  # u at action 1
    omega: float  # w, rad/s
    tick: float  # s, of the control


@kernel
def acceleration_of(
    smooth: SmoothTarget, action: np.ndarray, target: np.ndarray, target_rate: np.ndarray
) -> np.ndarray:
    """Return the accelerations (N, n) per s^2 of targets (N, n) and their rates, for actions."""
    acceleration = np.empty(action.shape)
    for i in range(len(action)):
        for j in range(action.shape[1]):
            error = target[i, j] - smooth.scale * action[i, j]
            twice = 2.0 * target_rate[i, j] + smooth.omega * error
            acceleration[i, j] = -smooth.omega * twice
    return acceleration


@kernel
def move_on(
    smooth: SmoothTarget, action: np.ndarray, target: np.ndarray, target_rate: np.ndarray
) -> None:
    """Move targets (N, n) and their rates on to the next tick, for actions (N, n)."""
    omega, tick = smooth.omega, smooth.tick
    decay = np.exp(-omega * tick)
    for i in range(len(action)):
        for j in range(action.shape[1]):
            goal = smooth.scale * action[i, j]
            error, rate = target[i, j] - goal, target_rate[i, j]
            travel = (rate + omega * error) * tick
            target[i, j] = goal + (error + travel) * decay
            target_rate[i, j] = (rate - omega * travel) * decay


_BALANCE = Falling(1.7)  # where a motion is planned: critically damped, eq. (20)


@dataclass(frozen=True, eq=False)
class JointPositionFeedforward(LawLayer):
    """tau = InvDyn(q, qdot, qdd_d) + K_P (q_d - q) + K_D (qdot_d - qdot), [M10] eq. (18).

    The desired motion of the joints is that of the target and, added to it, an offset x that
    follows scale * action as a critically damped second-order system does; so it has the rate and
    the acceleration that eq. (18) asks for. That of the base is the target's.

    In qdd_d balance comes first and the desired motion acts in what it leaves, which is eq. (19).
    The balance is eq. (20): the centre of mass returns, in x and y, to the target's,

        xdd_d = xdd_t + w^2 (x_t - x) + 2 w (xdot_t - xdot).

    The paper lets the base's Jacobian stand for that of the centre of mass, which is here its own:
    the base's rows of M over the mass. InvDyn is eq. (15), by default with limits on the contact
    forces; the feedback is not limited, one more reason for it to be soft.
    """

    law: BodyLaw  # InvDyn
    motion: JointMotion  # of base and joints
    offset: SmoothTarget  # added to the joints' target; its scale in rad (m for slides)
    gains: JointGains  # K_P and K_D
    # w^2 (1/s^2) and 2 w (1/s) of the centre of mass; None for eq. (18) without balance.
    balance: tuple[float, float] | None
    contact: ContactOptions  # what it assumes of contacts
    in_drives: bool  # whether the motors' drives make the feedback

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
        scale: TargetScale = 0.3,
        target_frequency: Frequency = Falling(3.4),
        balance_frequency: Annotated[
            float | Falling | tuple[float, float], Hertz(least=0.0, gains=True)
        ]
        | None = None,
        loop_delay: LoopDelay = 0.0,
        in_drives: bool | None = None,
        contact: ContactOptions = CONTACT_DEFAULTS,
    ) -> "JointPositionFeedforward":
        """Build the layer.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            kind: of motion.
            natural_frequency: Hz of the feedback, see `JointGains`. It need only be as stiff as
                falling is fast: the model carries the weight and the motion. Default: that of
                falling; for gaits on point feet that with which the base is held.
            damping_ratio: of the feedback.
            scale: rad (m for slides) at action 1.
            target_frequency: Hz, at which the offset follows the action.
            balance_frequency: w / (2 pi) in Hz, or a pair, stiffness (1/s^2) and damping (1/s); 0
                for eq. (18) without balance. Default: that of `fbid_gym.actions.gains`.
            loop_delay: s from the state to the torque that answers it, for which the gains of the
                feedback are steady.
            in_drives: whether the motors' drives make the feedback, as on most legged robots: see
                `joint_position`. Default: unless the layer is told of a `loop_delay`.
            contact: what it assumes of contacts.

        Raises:
            InvalidValueError: out of range, beyond what any joint can be held with, or a delay of
                drives.
        """
        balance = balance_frequency or (None if kind.gait else _BALANCE)
        own = BodyOptions(balance_frequency=balance).gains(robot, kind)
        if natural_frequency is None:
            # Stiffer ankles tip robots on soles.
            firm = kind.gait and not robot.has_soles
            natural_frequency = in_hz(max(own.height, own.rotation)) if firm else Falling(1.0)
        frequency = in_hertz(robot, target_frequency)
        assumed = contact.on(robot, kind)
        firm_feet = own._replace(hold=0.0)
        return cls(
            law=BodyLaw.of(robot, control_hz, assumed, firm_feet, 1.0, joints_first=True),
            motion=JointMotion.of(robot, kind, own, aware=True),
            offset=SmoothTarget(scale, 2.0 * np.pi * frequency, 1.0 / control_hz),
            gains=JointGains.of(robot, control_hz, natural_frequency, damping_ratio, loop_delay),
            balance=None if balance_frequency == 0.0 else (own.balance, own.balance_damping),
            contact=assumed,
            in_drives=closed_in_drives(in_drives, loop_delay),
        )

    @property
    def natural_frequency(self) -> float:
        """Hz, of the response that the gains give."""
        return self.gains.natural_frequency

    @property
    def balance_frequency(self) -> tuple[float, float] | float:
        """Stiffness and damping of the centre of mass's return; 0 for none."""
        return self.balance or 0.0

    @property
    def action_names(self) -> tuple[str, ...]:
        """One target a joint."""
        return tuple(
            f"target of {joint} from its reference (x {self.offset.scale:g} rad)"
            for joint in self.law.robot.joint_names
        )

    def memory(self, num_robots: int) -> Memory:
        """Of the law and of the offset, which rests at zero."""
        offset, offset_rate = np.zeros((2, num_robots, self.law.robot.num_joints))
        return self.law.memory(num_robots) | {"target": offset, "target_rate": offset_rate}

    def torque(
        self, action: np.ndarray, state: RobotState, target: Target, terms: GetTerms, memory: Memory
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        known, offset, offset_rate = terms(), memory["target"], memory["target_rate"]
        followed = self.motion.target(state, target, known)
        added = acceleration_of(self.offset, action, offset, offset_rate)
        command = _follow(np.array(self.balance or ()), added, followed, known)
        torque = self.law.torque(command, state, target, known, memory)
        joints = JointTarget.of(followed)
        torque = feedback(self.gains, offset, offset_rate, torque, state, joints)
        move_on(self.offset, action, offset, offset_rate)
        return torque

    def drive_torque(self, state: RobotState) -> np.ndarray | None:
        """See `ActionLayer`."""
        return at_joints(self.gains, state) if self.in_drives else None


@kernel
def _follow(
    balance: np.ndarray, added: np.ndarray, target: Target, terms: DynamicsTerms
) -> Command:
    """Desired motion of eq. (18), and the centre of mass's by eq. (20), where `balance` has two.

    To the accelerations of the joints comes what is `added` (N, n).
    """
    count, joints = added.shape
    desired, body = target.qacc.copy(), np.empty((count, len(balance)))
    for i in range(count):
        for j in range(joints):
            desired[i, 6 + j] += added[i, j]
        for k in range(len(balance)):
            place = target.com[i, k] - terms.com[i, k]
            rate = target.com_velocity[i, k] - terms.com_velocity[i, k]
            body[i, k] = target.com_acceleration[i, k] + balance[0] * place + balance[1] * rate
    return Command(desired, body, np.empty((0, 6)))
