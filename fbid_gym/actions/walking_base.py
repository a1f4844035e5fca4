"""Layers that walk with their feet as tasks; the action adds to what the body shall do."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.base_acceleration import action_scale
from fbid_gym.actions.com_wrench import wrench_scale_of
from fbid_gym.actions.contact_options import ContactOptions
from fbid_gym.actions.law_memory import DIAGNOSTICS
from fbid_gym.actions.walking_law import WalkingGains, WalkingLaw, base_task, lean
from fbid_gym.compiled import kernel
from fbid_gym.dynamics.centroidal import centroidal_terms
from fbid_gym.dynamics.stance import Stance
from fbid_gym.motions.gait.target import GaitTarget
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, TaskCommand
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import dot

_AXES = ("ahead", "to the left", "up")


@dataclass(frozen=True, eq=False)
class WalkingBaseAcceleration:
    """The body accelerates as the gait asks, plus scale * action; an `ActionLayer`.

    Horizontally the gait says how the centre of mass accelerates; the base is held at its height,
    upright and in its heading by springs. The feet in the air go where the gait wants them, those
    on the ground stay; forces keep within the friction cones. Scales as in `BaseAcceleration`.

    Attributes:
        law: from the body's task to torque.
        scale: (6,) m/s^2 and rad/s^2 at action 1.
    """

    law: WalkingLaw
    scale: np.ndarray

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        omega: float,
        *,
        contact_limits: str = "friction",
        friction: float = 0.6,
        compensate_damping: bool = True,
    ) -> "WalkingBaseAcceleration":
        """Build the layer.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            omega: 1/s, rate at which the robot falls, see `Gait`.
            contact_limits: "friction" limits the contact forces; "none" is the papers' form.
            friction: coefficient assumed of every contact.
            compensate_damping: add the torque that the joints' viscous damping takes away.
        """
        contact = ContactOptions(
            contact_limits=contact_limits, friction=friction, compensate_damping=compensate_damping
        )
        scale = action_scale(robot, Stance.of(robot), friction)
        return cls(WalkingLaw.of(robot, omega, contact), scale)

    @property
    def action_names(self) -> tuple[str, ...]:
        """Six accelerations of the base."""
        names = [f"base acceleration {axis}, heading" for axis in _AXES]
        names += [f"base angular acceleration {axis}, base frame" for axis in "xyz"]
        return _named(names, self.scale, "m/s^2", "rad/s^2")

    diagnostics: tuple[str, ...] = DIAGNOSTICS

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
        gains, known = self.law.constants.gains, terms()
        task = base_task(gains, self.scale * action, state, reference, known)
        return self.law.torque(task, state, reference, known, memory)


@dataclass(frozen=True, eq=False)
class WalkingComWrench:
    """The momentum changes as the gait asks, plus scale * action; an `ActionLayer`.

    What `WalkingBaseAcceleration` is for the base, this is for the momentum: a desired wrench at
    the centre of mass, of weight, the gait's horizontal force, a spring on the height and, as in
    [G15] (38), (39), a rotational spring on the base and damping of the angular momentum; through
    full inverse dynamics. Scales as in `ComWrench`.

    Attributes:
        law: from the body's task to torque.
        scale: (6,) N and N·m at action 1.
    """

    law: WalkingLaw
    scale: np.ndarray

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        omega: float,
        *,
        contact_limits: str = "friction",
        friction: float = 0.6,
        compensate_damping: bool = True,
    ) -> "WalkingComWrench":
        """Build the layer; arguments as for `WalkingBaseAcceleration`."""
        contact = ContactOptions(
            contact_limits=contact_limits, friction=friction, compensate_damping=compensate_damping
        )
        scale = wrench_scale_of(robot, Stance.of(robot), friction)
        return cls(WalkingLaw.of(robot, omega, contact), scale)

    @property
    def action_names(self) -> tuple[str, ...]:
        """Six components of the wrench at the centre of mass."""
        names = [f"force {axis} at the centre of mass, heading" for axis in _AXES]
        names += [f"moment {axis} about the centre of mass, heading" for axis in _AXES]
        return _named(names, self.scale, "N", "N·m")

    diagnostics: tuple[str, ...] = DIAGNOSTICS

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
        law, known = self.law.constants, terms()
        task = momentum_task(law.gains, law.gravity, self.scale * action, state, reference, known)
        return self.law.torque(task, state, reference, known, memory)


def _named(names: list[str], scale: np.ndarray, linear: str, angular: str) -> tuple[str, ...]:
    units = [linear] * 3 + [angular] * 3
    return tuple(
        f"{name} (x {size:.3g} {unit})"
        for name, size, unit in zip(names, scale, units, strict=True)
    )


@kernel
def momentum_task(
    gains: WalkingGains,
    gravity: float,
    push: np.ndarray,
    state: RobotState,
    target: GaitTarget,
    terms: DynamicsTerms,
) -> TaskCommand:
    """What the momentum shall do, per mass and per inertia of the robot with locked joints.

    Args:
        gains: of the robot.
        gravity: m/s^2.
        push: (N, 6) N and N·m to add, along the heading.
        state: of the robots.
        target: of the gait.
        terms: of the robots.
    """
    body = centroidal_terms(terms, state.qvel)
    count, size = state.qvel.shape
    jacobian, bias = np.empty((count, 6, size)), np.empty((count, 6))
    acceleration, turn, spring = np.empty((count, 6)), np.empty(3), np.empty(3)
    for i in range(count):
        mass, inverse = body.mass[i], body.inverse_inertia[i]
        for k in range(3):
            for j in range(size):
                jacobian[i, k, j] = body.matrix[i, k, j] / mass
                total = 0.0
                for axis in range(3):
                    total += inverse[k, axis] * body.matrix[i, 3 + axis, j]
                jacobian[i, 3 + k, j] = total
        # Adot v: what the base's bias force says of it, less gravity's share.
        for k in range(6):
            bias[i, k] = dot(body.to_com[i, k], terms.bias[i, :6])
        bias[i, 2] -= gravity * mass
        for k in range(3):
            bias[i, k] /= mass
        for k in range(3):
            turn[k] = dot(inverse[k], bias[i, 3:])
        bias[i, 3:] = turn

        cosine, sine = np.cos(target.heading[i]), np.sin(target.heading[i])
        ahead, left, up = push[i, 0], push[i, 1], push[i, 2]
        acceleration[i, 0] = target.com_acceleration[i, 0] + (cosine * ahead - sine * left) / mass
        acceleration[i, 1] = target.com_acceleration[i, 1] + (sine * ahead + cosine * left) / mass
        rise = target.height[i] - terms.base_position[i, 2]
        acceleration[i, 2] = gains.height * rise - gains.height_damping * terms.com_velocity[i, 2]
        acceleration[i, 2] += up / mass

        error, rotation = lean(target, terms, i), terms.world_from_base[i]
        ahead, left, up = push[i, 3], push[i, 4], push[i, 5]
        moment = (cosine * ahead - sine * left, sine * ahead + cosine * left, up)
        for k in range(3):
            # In the world: the base's error, the average angular velocity, the action.
            spring[k] = rotation[k, 0] * error[0] + rotation[k, 1] * error[1]
            spring[k] += rotation[k, 2] * error[2]
            average = dot(inverse[k], body.momentum[i, 3:])
            wanted = target.turning[i] if k == 2 else 0.0
            pushed = (
                inverse[k, 0] * moment[0] + inverse[k, 1] * moment[1] + inverse[k, 2] * moment[2]
            )
            acceleration[i, 3 + k] = gains.rotation * spring[k] + pushed
            acceleration[i, 3 + k] += gains.rotation_damping * (wanted - average)
    return TaskCommand(jacobian, bias, acceleration)
