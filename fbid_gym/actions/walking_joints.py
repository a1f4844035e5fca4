"""Layers that walk with their joints: those that track joints, on the joint motions of a gait."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.joint_acceleration import JointAcceleration
from fbid_gym.actions.joint_position import JointPosition
from fbid_gym.actions.joint_position_feedforward import JointPositionFeedforward
from fbid_gym.actions.layer import ActionLayer
from fbid_gym.actions.torque import Torque
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import UnknownOptionError
from fbid_gym.motions import home_reference
from fbid_gym.motions.gait.joints import Legs, joint_reference, legs_of
from fbid_gym.motions.gait.target import GaitTarget
from fbid_gym.quantities import DynamicsTerms, Memory, Reference, RobotState
from fbid_gym.robots import Robot

REFERENCES = ("gait", "home")


@dataclass(frozen=True, eq=False)
class JointsOfGait:
    """A layer that tracks joints, on a gait: its zero action follows the gait's joint motion.

    Attributes:
        inner: the layer.
        legs: of the robot.
        stance: of the robot.
    """

    inner: ActionLayer
    legs: Legs
    stance: Stance

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
        known = terms()
        joints = joint_reference(self.legs, reference, state, known, self.stance.frame(known))
        return self.inner.torque(action, state, joints, terms, memory)


@dataclass(frozen=True, eq=False)
class JointsAtHome:
    """A layer on the home posture while the task walks: no gait, the action is all there is.

    Attributes:
        inner: the layer.
        home: what it follows.
    """

    inner: ActionLayer
    home: Reference

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
        return self.inner.torque(action, state, self.home, terms, memory)


def walking_torque(robot: Robot, control_hz: int, omega: float) -> ActionLayer:
    """Build layer `torque`: the action is the torque, beside that which holds the home stance."""
    return JointsAtHome(Torque.of(robot, control_hz), home_reference(robot))


def walking_joint_position(
    robot: Robot,
    control_hz: int,
    omega: float,
    *,
    reference: str = "gait",
    natural_frequency: float | None = None,
    damping_ratio: float = 1.0,
    scale: float = 0.3,
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
    if reference == "home":
        return JointsAtHome(inner, home_reference(robot))
    if reference != "gait":
        raise UnknownOptionError("reference", reference, REFERENCES)
    return _on_gait(robot, inner)


def walking_feedforward(
    robot: Robot,
    control_hz: int,
    omega: float,
    *,
    natural_frequency: float | None = None,
    damping_ratio: float = 1.0,
    scale: float = 0.3,
    target_frequency: float = 2.0,
) -> ActionLayer:
    """Build layer `joint_position_feedforward`; arguments as for `JointPositionFeedforward`."""
    inner = JointPositionFeedforward.of(
        robot,
        control_hz,
        natural_frequency=natural_frequency,
        damping_ratio=damping_ratio,
        scale=scale,
        target_frequency=target_frequency,
    )
    return _on_gait(robot, inner)


def walking_joint_acceleration(
    robot: Robot,
    control_hz: int,
    omega: float,
    *,
    natural_frequency: float = 3.0,
    damping_ratio: float = 1.0,
    scale: float = 30.0,
) -> ActionLayer:
    """Build layer `joint_acceleration`; arguments as for `JointAcceleration`."""
    inner = JointAcceleration.of(
        robot,
        control_hz,
        natural_frequency=natural_frequency,
        damping_ratio=damping_ratio,
        scale=scale,
    )
    return _on_gait(robot, inner)


def _on_gait(robot: Robot, inner: ActionLayer) -> ActionLayer:
    return JointsOfGait(inner, legs_of(robot), Stance.of(robot))
