"""Layers that walk with their joints: those that track joints, on the joint motions of a gait."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from fbid_gym.actions.contact_options import WALKING_CONTACT_DEFAULTS, WalkingContact
from fbid_gym.actions.falling import Falling
from fbid_gym.actions.joint_acceleration import JointAcceleration
from fbid_gym.actions.joint_gains import SERVO
from fbid_gym.actions.joint_position import JointPosition
from fbid_gym.actions.joint_position_feedforward import JointPositionFeedforward
from fbid_gym.actions.layer import ActionLayer
from fbid_gym.actions.ranges import (
    AccelerationScale,
    DampingRatio,
    Frequency,
    Hertz,
    TargetScale,
)
from fbid_gym.actions.torque import Torque
from fbid_gym.actions.walking_gains import WalkingGains
from fbid_gym.compiled import bind
from fbid_gym.motions import home_reference
from fbid_gym.motions.gait.joints import joint_reference, leg_joints_of
from fbid_gym.motions.gait.target import GaitTarget
from fbid_gym.options import Choice, checked
from fbid_gym.quantities import DynamicsTerms, Memory, Reference, RobotState
from fbid_gym.robots import Robot

ReferenceOf = Callable[[GaitTarget, RobotState, Callable[[], DynamicsTerms]], Reference]
"""What a layer follows, from the target of a gait and the robots as they are."""


@dataclass(frozen=True, eq=False)
class Following:
    """A layer that follows another reference than the gait's target; an `ActionLayer`.

    Attributes:
        inner: the layer.
        reference_of: what it follows.
        contact_ramp: s, of the layer's law, see `WalkingContact`; None where it has none.
    """

    inner: ActionLayer
    reference_of: ReferenceOf
    contact_ramp: float | None = None

    @property
    def action_names(self) -> tuple[str, ...]:
        """Of the layer."""
        return self.inner.action_names

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """Of the layer."""
        return self.inner.diagnostics

    def memory(self, num_robots: int) -> Memory:
        """Of the layer."""
        return self.inner.memory(num_robots)

    def torque(
        self,
        action: np.ndarray,
        state: RobotState,
        reference: GaitTarget,
        terms: Callable[[], DynamicsTerms],
        memory: Memory,
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        followed = self.reference_of(reference, state, terms)
        return self.inner.torque(action, state, followed, terms, memory)


def joints_of_gait(robot: Robot, *, aware: bool) -> ReferenceOf:
    """Return what makes the joint motion of a gait, on which the zero action walks.

    Args:
        robot: the robot.
        aware: see `LegJoints`.
    """
    follow = bind(joint_reference, leg_joints_of(robot, aware))
    return lambda target, state, terms: follow(target, state, terms())


def home_posture(robot: Robot) -> ReferenceOf:
    """Return what stays at home while the task walks: no gait, the action is all there is."""
    home = home_reference(robot)
    return lambda target, state, terms: home


def body_frequency(robot: Robot, omega: float) -> float:
    """Hz with which the base is held where it is a task of its own: its height and rotation."""
    gains = WalkingGains.of(robot, omega)
    return float(np.sqrt(max(gains.height, gains.rotation))) / (2.0 * np.pi)


def swing_frequency(robot: Robot, omega: float) -> float:
    """Hz with which a foot in the air is held to its path where it is a task of its own."""
    return float(np.sqrt(WalkingGains.of(robot, omega).swing)) / (2.0 * np.pi)


def walking_torque(robot: Robot, control_hz: int, omega: float) -> ActionLayer:
    """Build layer `torque`: the action is the torque, beside that which holds the home stance."""
    return Following(Torque.of(robot, control_hz), home_posture(robot))


@checked
def walking_joint_position(
    robot: Robot,
    control_hz: int,
    omega: float,
    *,
    reference: Annotated[str, Choice(("gait", "home"))] = "gait",
    natural_frequency: Annotated[float | str, Hertz(also=(SERVO,))] | None = None,
    damping_ratio: DampingRatio = 1.0,
    scale: TargetScale = 0.3,
) -> ActionLayer:
    """Build layer `joint_position`.

    Args:
        robot: whose joints.
        control_hz: control ticks per second.
        omega: 1/s, rate at which the robot falls; not used.
        reference: "gait", what the targets of the zero action follow; or "home", the home posture.
        natural_frequency: Hz, see `JointPosition`.
        damping_ratio: see `JointPosition`.
        scale: rad at action 1.
    """
    inner = JointPosition.of(
        robot,
        control_hz,
        natural_frequency=natural_frequency,
        damping_ratio=damping_ratio,
        scale=scale,
    )
    follow = home_posture(robot) if reference == "home" else joints_of_gait(robot, aware=False)
    return Following(inner, follow)


@checked
def walking_feedforward(
    robot: Robot,
    control_hz: int,
    omega: float,
    *,
    natural_frequency: Frequency | None = None,
    damping_ratio: DampingRatio = 1.0,
    scale: TargetScale = 0.3,
    target_frequency: Frequency = Falling(3.4),
    contact: WalkingContact = WALKING_CONTACT_DEFAULTS,
) -> ActionLayer:
    """Build layer `joint_position_feedforward`; other arguments as for `JointPositionFeedforward`.

    Args:
        robot: whose joints.
        control_hz: control ticks per second.
        omega: 1/s, rate at which the robot falls, see `Gait`.
        natural_frequency: Hz of the feedback. Default, on point feet: as the legs that stand hold
            the base, see `body_frequency`. Legs in the air move less inertia, and are as much
            stiffer. On soles that of `JointPositionFeedforward`: stiffer ankles tip them.
        damping_ratio: of the feedback.
        scale: rad at action 1.
        target_frequency: Hz, at which the offset follows the action.
        contact: what it assumes of contacts.
    """
    own = Falling(1.0) if robot.has_soles else body_frequency(robot, omega)
    options = contact.options(robot, omega)
    inner = JointPositionFeedforward.of(
        robot,
        control_hz,
        natural_frequency=own if natural_frequency is None else natural_frequency,
        damping_ratio=damping_ratio,
        scale=scale,
        target_frequency=target_frequency,
        contact=options,
    )
    return Following(inner, joints_of_gait(robot, aware=True), options.contact_ramp)


@checked
def walking_joint_acceleration(
    robot: Robot,
    control_hz: int,
    omega: float,
    *,
    natural_frequency: Frequency | None = None,
    damping_ratio: DampingRatio = 1.0,
    scale: AccelerationScale | None = None,
    contact: WalkingContact = WALKING_CONTACT_DEFAULTS,
) -> ActionLayer:
    """Build layer `joint_acceleration`.

    Args:
        robot: whose joints.
        control_hz: control ticks per second.
        omega: 1/s, rate at which the robot falls, see `Gait`.
        natural_frequency: Hz, of the joints' return to their reference. Default: what the feet in
            the air need, see `swing_frequency`.
        damping_ratio: see `JointAcceleration`.
        scale: rad/s^2 at action 1, see `JointAcceleration`.
        contact: what it assumes of contacts.
    """
    if natural_frequency is None:
        natural_frequency = swing_frequency(robot, omega)
    options = contact.options(robot, omega)
    inner = JointAcceleration.of(
        robot,
        control_hz,
        natural_frequency=natural_frequency,
        damping_ratio=damping_ratio,
        scale=scale,
        contact=options,
    )
    return Following(inner, joints_of_gait(robot, aware=True), options.contact_ramp)
