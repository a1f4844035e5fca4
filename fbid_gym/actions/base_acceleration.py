"""Layer `base_acceleration`: a task-space stabiliser of the body, to which the action adds."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions
from fbid_gym.actions.gains import BODY_DEFAULTS, PRIORITY_ACTION, BodyOptions, meant, set_priority
from fbid_gym.actions.law import BodyLaw, LawLayer
from fbid_gym.actions.layer import GetTerms, scaled_names
from fbid_gym.control.body_law import Command, stabilise
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.motions.target import MotionKind
from fbid_gym.quantities import DynamicsTerms, Memory, RobotState, Target
from fbid_gym.robots import Robot


@dataclass(frozen=True, eq=False)
class BaseAcceleration(LawLayer):
    """The body accelerates towards its target, plus scale * action.

    With w and zeta of each part:

        linear, x and y:  a + w^2 (target - centre of mass) + 2 zeta w (target rate - its velocity)
        linear, z:        a + w^2 (target - base height)    + 2 zeta w (target rate - its velocity)
        angular:          a + w^2 (rotation error)          + 2 zeta w (target rate - its rate)

    where a is the target's acceleration; on a gait the first velocity is the base's. Feet go first,
    the body in what they leave, the joints near their target in the rest: `fbid_gym.actions.law`.

    The scale of the action is what the contacts can do: horizontally the acceleration that moves
    the centre of pressure from below the centre of mass to the nearest edge of the support polygon,
    g * margin / height, but no more than friction allows; vertically half of gravity; for tilting
    the moment that the same shift gives, for turning that of friction, on the home inertia. Or it
    is the same on all robots, see `BodyOptions.action_units`.
    """

    law: BodyLaw  # from acceleration to torque
    scale: np.ndarray  # (6,) m/s^2 and rad/s^2 at action 1
    contact: ContactOptions  # what it assumes of contacts
    moment_priority: float | tuple[float, float]  # of the law
    meant: Mapping[str, Any]  # name of an option that may be None -> what it means
    priority_action: bool  # whether the action changes the priority

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        kind: MotionKind,
        *,
        body: BodyOptions = BODY_DEFAULTS,
        contact: ContactOptions = CONTACT_DEFAULTS,
    ) -> "BaseAcceleration":
        """Build the layer.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            kind: of motion.
            body: how firmly it is held.
            contact: what it assumes of contacts.
        """
        assumed, priority = contact.on(robot, kind), body.priority(robot, kind)
        held, delay = body.gains(robot, kind), body.loop_delay
        law = BodyLaw.of(robot, control_hz, assumed, held, priority, delay=delay)
        stance = Stance.of(robot)
        if body.action_units == "robot":
            scale = robot.gravity * np.repeat([0.5, 2.0 / stance.home_com[2]], 3)
        else:
            scale = action_scale(robot, stance, assumed.coefficient)
        body.check_priority_action(law.limited)
        return cls(law, scale, assumed, priority, meant(held, kind), body.priority_action)

    @property
    def action_names(self) -> tuple[str, ...]:
        """Six accelerations of the base, and the priority if it is one."""
        names = [f"base acceleration {axis}, heading" for axis in ("ahead", "to the left", "up")]
        names += [f"base angular acceleration {axis}, base frame" for axis in "xyz"]
        more = (PRIORITY_ACTION,) if self.priority_action else ()
        return (*scaled_names(names, self.scale, "m/s^2", "rad/s^2"), *more)

    @property
    def per_acceleration(self) -> np.ndarray:
        """Action for each m/s^2 of the body ahead and to the left, (2,)."""
        return 1.0 / self.scale[:2]

    def torque(
        self, action: np.ndarray, state: RobotState, target: Target, terms: GetTerms, memory: Memory
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        known = terms()
        set_priority(action, memory)
        command = Command.to_target(self.scale * action[:, :6])
        return self.law.torque(command, state, target, known, memory)

    def desired(
        self, action: np.ndarray, state: RobotState, target: Target, terms: DynamicsTerms
    ) -> np.ndarray:
        """Return the acceleration that it asks of the body, (N, 3) m/s^2, world."""
        command = Command.to_target(self.scale * action[:, :6])
        return stabilise(self.law.constants, command, state, target, terms).body[:, :3]


def action_scale(robot: Robot, stance: Stance, friction: float) -> np.ndarray:
    """Return the accelerations of action 1, see `BaseAcceleration`: (6,) m/s^2 and rad/s^2."""
    inertia, margin = np.diag(stance.terms.mass_matrix[0])[3:6], stance.margin
    linear = robot.gravity * np.minimum(margin / stance.home_com[2], friction)
    tilting = robot.weight * margin[::-1]  # a sideways shift rolls, a forward shift pitches
    turning = friction * robot.weight * stance.radius
    # About an axis of the base: until one about an axis of the trunk is at its end.
    share = np.maximum(np.abs(base_from_trunk(robot)), 1e-9)
    moment = (np.append(tilting, turning) / share).min(axis=1)
    return np.concatenate([linear, [0.5 * robot.gravity], moment / inertia])
