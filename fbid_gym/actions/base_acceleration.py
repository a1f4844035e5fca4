"""Layer `base_acceleration`: a task-space stabiliser of the body, to which the action adds."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions
from fbid_gym.actions.gains import (
    BodyGains,
    VelocityGain,
    chosen_gains,
    default_moment_priority,
    meant,
)
from fbid_gym.actions.law import Law, stabilise
from fbid_gym.actions.ranges import DampingRatio, Priority, Response
from fbid_gym.actions.scaled_names import scaled_names
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.motions.target import MotionKind
from fbid_gym.options import checked
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target
from fbid_gym.robots import Robot

_VERTICAL_SCALE = 0.5  # of gravity: half the weight more, or half less


@dataclass(frozen=True, eq=False)
class BaseAcceleration:
    """The body accelerates towards its target, plus scale * action.

    With w and zeta of each part:

        linear, x and y:  a + w^2 (target - centre of mass) + 2 zeta w (target rate - its velocity)
        linear, z:        a + w^2 (target - base height)    + 2 zeta w (target rate - its velocity)
        angular:          a + w^2 (rotation error)          + 2 zeta w (target rate - its rate)

    where a is the target's acceleration. Feet go first, the body in what they leave, the joints
    near their target in the rest: see `fbid_gym.actions.law`.

    The scale of the action is what the contacts can do: horizontally the acceleration that moves
    the centre of pressure from below the centre of mass to the nearest edge of the support polygon,
    g * margin / height, but no more than friction allows; vertically half of gravity; for tilting
    the moment that the same shift gives, for turning that of friction, on the home inertia.

    Attributes:
        law: from acceleration to torque.
        scale: (6,) m/s^2 and rad/s^2 at action 1.
        contact: what it assumes of contacts.
        moment_priority: of the law.
    """

    law: Law
    scale: np.ndarray
    contact: ContactOptions
    moment_priority: float

    @classmethod
    @checked
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        kind: MotionKind,
        *,
        balance_frequency: Response | None = None,
        height_frequency: Response | None = None,
        rotation_frequency: Response | None = None,
        posture_frequency: Response | None = None,
        swing_frequency: Response | None = None,
        damping_ratio: DampingRatio | None = None,
        moment_priority: Priority | None = None,
        velocity_gain: VelocityGain = 0.0,
        contact: ContactOptions = CONTACT_DEFAULTS,
    ) -> "BaseAcceleration":
        """Build the layer. What is None is taken from the table in `fbid_gym.actions.gains`.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            kind: of motion.
            balance_frequency: Hz, of the centre of mass's horizontal return to its target; this and
                the next four may be a pair, stiffness (1/s^2) and damping (1/s).
            height_frequency: Hz, of the base's vertical return.
            rotation_frequency: Hz, of the base's orientation.
            posture_frequency: Hz, of the joints.
            swing_frequency: Hz, of feet in the air.
            damping_ratio: zeta, of all of them.
            moment_priority: weight of squared errors of the moment on the base (per weight and mean
                distance of the contact points) beside one for the force (per weight), where the
                contacts cannot deliver both, as on two diagonal point feet. Less of it follows
                velocities more closely, and falls sooner when pushed.
            velocity_gain: on point feet, by how much more small errors of the horizontal velocity
                are damped, in units of the rate at which the robot falls; a gait's own damping is
                4. Errors greater than 0.03 of sqrt(gravity times height) count as that much.
            contact: what it assumes of contacts.
        """
        frequencies = {
            "balance": balance_frequency,
            "height": height_frequency,
            "rotation": rotation_frequency,
            "posture": posture_frequency,
            "swing": swing_frequency,
        }
        gains = chosen_gains(robot, kind, damping_ratio, velocity_gain, **frequencies)
        if moment_priority is None:
            moment_priority = default_moment_priority(robot, kind)
        assumed = contact.on(robot, kind)
        law = Law.of(robot, control_hz, assumed, gains, moment_priority)
        scale = action_scale(robot, Stance.of(robot), assumed.coefficient)
        return cls(law, scale, assumed, moment_priority)

    @property
    def gains(self) -> BodyGains:
        """Of feet, body and joints."""
        return self.law.constants.gains

    @property
    def meant(self) -> Mapping[str, Any]:
        """Name of an option that may be None -> what it means."""
        return meant(self.gains)

    @property
    def action_names(self) -> tuple[str, ...]:
        """Six accelerations of the base."""
        names = [f"base acceleration {axis}, heading" for axis in ("ahead", "to the left", "up")]
        names += [f"base angular acceleration {axis}, base frame" for axis in "xyz"]
        return scaled_names(names, self.scale, "m/s^2", "rad/s^2")

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
        target: Target,
        terms: Callable[[], DynamicsTerms],
        memory: Memory,
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        known = terms()
        command = stabilise(self.law.constants, self.scale * action, state, target, known)
        return self.law.torque(command, state, target, known, memory)

    def desired(
        self, action: np.ndarray, state: RobotState, target: Target, terms: DynamicsTerms
    ) -> np.ndarray:
        """Return the acceleration that it asks of the body, (N, 3) m/s^2, world."""
        command = stabilise(self.law.constants, self.scale * action, state, target, terms)
        return command.body[:, :3]


def action_scale(robot: Robot, stance: Stance, friction: float) -> np.ndarray:
    """What action 1 means, see `BaseAcceleration`: (6,) m/s^2 and rad/s^2."""
    inertia, margin = np.diag(stance.terms.mass_matrix[0])[3:6], stance.margin
    linear = robot.gravity * np.minimum(margin / stance.home_com[2], friction)
    tilting = robot.weight * margin[::-1]  # a sideways shift rolls, a forward shift pitches
    turning = friction * robot.weight * stance.radius
    # About an axis of the base: until one about an axis of the trunk is at its end.
    share = np.maximum(np.abs(base_from_trunk(robot)), 1e-9)
    moment = (np.append(tilting, turning) / share).min(axis=1)
    return np.concatenate([linear, [_VERTICAL_SCALE * robot.gravity], moment / inertia])
