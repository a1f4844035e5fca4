"""Layers that walk with their feet as tasks; the action adds to what the body shall do."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from fbid_gym.actions.base_acceleration import action_scale
from fbid_gym.actions.com_wrench import wrench_scale_of
from fbid_gym.actions.contact_options import WALKING_CONTACT_DEFAULTS, WalkingContact
from fbid_gym.actions.scaled_names import scaled_names
from fbid_gym.actions.walking_law import BodyAim, WalkingConstants, WalkingLaw
from fbid_gym.actions.walking_tasks import base_aim, wrench_aim
from fbid_gym.compiled import bind
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions.gait.target import GaitTarget
from fbid_gym.options import Number, checked
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState
from fbid_gym.robots import Robot

VelocityGain = Annotated[float, Number(0.0, 100.0)]

_AXES = ("ahead", "to the left", "up")

Aim = Callable[
    [WalkingConstants, np.ndarray, RobotState, GaitTarget, DynamicsTerms],
    BodyAim,
]
"""A kernel."""


@dataclass(frozen=True, eq=False)
class WalkingBody:
    """The body moves as the gait asks, plus scale * action; an `ActionLayer`.

    The feet in the air go where the gait wants them, those on the ground stay; forces keep within
    the friction cones. What the body does beside is told by `aim`.

    Attributes:
        law: from the body's aim to torque.
        contact_ramp: s, of the law; see `WalkingContact`.
        aim: one of `walking_tasks`.
        scale: (6,) of the action, in the units of `aim`.
        action_names: six entries.
    """

    law: WalkingLaw
    contact_ramp: float
    aim: Aim
    scale: np.ndarray
    action_names: tuple[str, ...]

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """Of the law."""
        return self.law.diagnostics

    def memory(self, num_robots: int) -> Memory:
        """See `ActionLayer.memory`."""
        return self.law.memory(num_robots)

    def torque(
        self,
        action: np.ndarray,
        state: RobotState,
        reference: GaitTarget,
        terms: Callable[[], DynamicsTerms],
        memory: Memory,
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        known, added = terms(), self.scale * action
        aim = self._aim(added, state, reference, known)
        return self.law.torque(aim, state, reference, known, memory)

    @cached_property
    def _aim(self) -> Callable[..., BodyAim]:
        return bind(self.aim, self.law.constants)


@checked
def walking_base_acceleration(
    robot: Robot,
    control_hz: int,
    omega: float,
    *,
    velocity_gain: VelocityGain = 0.0,
    contact: WalkingContact = WALKING_CONTACT_DEFAULTS,
) -> WalkingBody:
    """Build the layer `base_acceleration` on a gait.

    Horizontally the gait says how the centre of mass accelerates; the base is held at its height,
    upright and in its heading by springs. Scales as in `BaseAcceleration`.

    Args:
        robot: whose joints.
        control_hz: control ticks per second.
        omega: 1/s, rate at which the robot falls, see `Gait`.
        velocity_gain: on point feet, by how much more than by the gait small errors of the
            horizontal velocity are answered, in units of the rate at which the robot falls. The
            gait's own share is 4. Errors greater than 0.03 of sqrt(gravity times height) count as
            that much.
        contact: what it assumes of contacts.
    """
    names = [f"base acceleration {axis}, heading" for axis in _AXES]
    names += [f"base angular acceleration {axis}, base frame" for axis in "xyz"]
    scale = action_scale(robot, Stance.of(robot), contact.friction)
    options = contact.options(robot, omega)
    law = WalkingLaw.of(robot, control_hz, omega, options, velocity_gain)
    return WalkingBody(
        law, options.contact_ramp, base_aim, scale, scaled_names(names, scale, "m/s^2", "rad/s^2")
    )


@checked
def walking_com_wrench(
    robot: Robot,
    control_hz: int,
    omega: float,
    *,
    velocity_gain: VelocityGain = 0.0,
    contact: WalkingContact = WALKING_CONTACT_DEFAULTS,
) -> WalkingBody:
    """Build the layer `com_wrench` on a gait.

    What that is for the base, this is for the momentum: a desired wrench at the centre of mass, as
    in [G15] (38), (39), through full inverse dynamics. Scales as in `ComWrench`.

    Args:
        robot: whose joints.
        control_hz: control ticks per second.
        omega: 1/s, rate at which the robot falls, see `Gait`.
        velocity_gain: as of `base_acceleration`.
        contact: what it assumes of contacts.
    """
    names = [f"force {axis} at the centre of mass, heading" for axis in _AXES]
    names += [f"moment {axis} about the centre of mass, heading" for axis in _AXES]
    scale = wrench_scale_of(robot, Stance.of(robot), contact.friction)
    options = contact.options(robot, omega)
    law = WalkingLaw.of(robot, control_hz, omega, options, velocity_gain)
    return WalkingBody(
        law, options.contact_ramp, wrench_aim, scale, scaled_names(names, scale, "N", "N·m")
    )
