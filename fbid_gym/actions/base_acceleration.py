"""Layer `base_acceleration`: a task-space stabiliser of the base, to which the action adds."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fbid_gym.actions.acceleration_law import AccelerationLaw
from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions
from fbid_gym.actions.falling import Falling, in_hertz
from fbid_gym.actions.ranges import DampingRatio, Frequency, Priority
from fbid_gym.actions.scaled_names import scaled_names
from fbid_gym.compiled import bind, kernel
from fbid_gym.dynamics.rotations import rotation_of
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.support import support_frame
from fbid_gym.dynamics.trunk import base_from_trunk
from fbid_gym.options import checked
from fbid_gym.quantities import DynamicsTerms, Heading, Memory, Reference, RobotState
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import dot, multiply, multiply_transposed

_VERTICAL_SCALE = 0.5  # of gravity: half the weight more, or half less


class _Gains(NamedTuple):
    """Of the stabiliser.

    Attributes:
        stiffness: (6,) w^2 of the base, 1/s^2.
        damping: (6,) 2 zeta w of the base, 1/s.
        posture_stiffness: w^2 of the joints, 1/s^2.
        posture_damping: 2 zeta w of the joints, 1/s.
    """

    stiffness: np.ndarray
    damping: np.ndarray
    posture_stiffness: float
    posture_damping: float


@dataclass(frozen=True, eq=False)
class BaseAcceleration:
    """The base accelerates back to its reference above the feet, plus scale * action.

    In the level frame of the feet (x forward, z up), with w and zeta of each part:

        linear, x and y:  a + w^2 (r - centre of mass) + 2 zeta w (rdot - its velocity)
        linear, z:        a + w^2 (r - base height)    + 2 zeta w (rdot - its velocity)
        angular:          a + w^2 (rotation error)     + 2 zeta w (rdot - angular velocity)
        joints:           a + w^2 (r - q)              + 2 zeta w (rdot - qdot)

    where r, rdot and a are the reference's; angular quantities are in the base's frame. The feet
    on the ground do not allow all of that. The nearest acceleration that they do allow is realised,
    where the base weighs `base_priority` times as much as the joints. A foot that the reference
    lifts swings as its joints follow theirs.

    The scale of the action is what the contacts can do: horizontally the acceleration that moves
    the centre of pressure from below the centre of mass to the nearest edge of the support polygon,
    g * margin / height, but no more than friction allows; vertically half of gravity; for tilting
    the moment that the same shift gives, for turning that of friction, on the home inertia.

    Attributes:
        law: from acceleration to torque.
        stance: the home stance.
        gains: of the stabiliser.
        scale: (6,) m/s^2 and rad/s^2 at action 1.
    """

    law: AccelerationLaw
    stance: Stance
    gains: _Gains
    scale: np.ndarray

    @classmethod
    @checked
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        *,
        balance_frequency: Frequency = Falling(1.7),
        height_frequency: Frequency = Falling(2.0),
        rotation_frequency: Frequency = Falling(2.0),
        posture_frequency: Frequency = Falling(1.7),
        damping_ratio: DampingRatio = 1.0,
        base_priority: Priority = 1e3,
        contact: ContactOptions = CONTACT_DEFAULTS,
    ) -> "BaseAcceleration":
        """Build the layer.

        Args:
            robot: whose joints.
            control_hz: control ticks per second.
            balance_frequency: Hz, of the centre of mass's horizontal return home.
            height_frequency: Hz, of the base's vertical return home.
            rotation_frequency: Hz, of the base's orientation.
            posture_frequency: Hz, of the joints.
            damping_ratio: zeta, of all four.
            base_priority: weight of squared base accelerations beside one for the joints. Towards
                infinity the posture is left to the null space of the base (1e6 is that, in
                effect); the default lets the posture give hard pushes way, which keeps the biped
                up more often.
            contact: what it assumes of contacts.
        """
        frequencies = in_hertz(
            robot,
            balance_frequency=balance_frequency,
            height_frequency=height_frequency,
            rotation_frequency=rotation_frequency,
            posture_frequency=posture_frequency,
        )
        balance, height, rotation, posture = 2.0 * np.pi * np.array(list(frequencies.values()))
        law = AccelerationLaw.of(robot, control_hz, contact, base_priority=base_priority)
        stance = Stance.of(robot)
        omega = np.array([balance, balance, height, rotation, rotation, rotation])
        gains = _Gains(
            stiffness=omega**2,
            damping=2.0 * damping_ratio * omega,
            posture_stiffness=posture**2,
            posture_damping=2.0 * damping_ratio * posture,
        )
        return cls(law, stance, gains, action_scale(robot, stance, contact.friction))

    @property
    def action_names(self) -> tuple[str, ...]:
        """Six accelerations of the base."""
        names = [f"base acceleration {axis}, support frame" for axis in "xyz"]
        names += [f"base angular acceleration {axis}, base frame" for axis in "xyz"]
        return scaled_names(names, self.scale, "m/s^2", "rad/s^2")

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """Of the acceleration law."""
        return self.law.diagnostics

    def memory(self, num_robots: int) -> Memory:
        """See `ActionLayer.memory`."""
        return self.law.memory(num_robots)

    def torque(
        self,
        action: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: Callable[[], DynamicsTerms],
        memory: Memory,
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        known = terms()
        acceleration = self.acceleration(action, state, reference, known)
        return self.law.torque(acceleration, state, reference, known, memory)

    def acceleration(
        self,
        action: np.ndarray,
        state: RobotState,
        reference: Reference,
        terms: DynamicsTerms,
    ) -> np.ndarray:
        """Return the desired acceleration (N, nv)."""
        return self._stabilise(action, state, reference, terms)

    @cached_property
    def _stabilise(self) -> Callable[..., np.ndarray]:
        return bind(_stabilise, self.gains, self.stance.heading, self.scale)


@kernel
def _stabilise(
    gains: _Gains,
    heading: Heading,
    scale: np.ndarray,
    action: np.ndarray,
    state: RobotState,
    reference: Reference,
    terms: DynamicsTerms,
) -> np.ndarray:
    """Return what `BaseAcceleration.acceleration` does; actions (N, 6) and their scale (6,)."""
    frame = support_frame(heading, terms)
    count, size = state.qvel.shape
    result = np.empty((count, size))
    target, upright, turn = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    lead, axial = np.empty(6), np.empty(3)
    stiffness, damping = gains.stiffness, gains.damping
    for i in range(count):
        row, level = min(i, len(reference.qpos) - 1), frame.world_from_support[i]
        # The base's orientation error, as the axial vector of the rotation that is left.
        rotation_of(reference.qpos[row, 3:7], upright)
        multiply(level, upright, target)
        multiply_transposed(terms.world_from_base[i], target, turn)
        axial[0] = 0.5 * (turn[2, 1] - turn[1, 2])
        axial[1] = 0.5 * (turn[0, 2] - turn[2, 0])
        axial[2] = 0.5 * (turn[1, 0] - turn[0, 1])

        # What does not depend on the state, in the support frame. The gains are the same along x
        # and y, so they commute with the turn about the vertical from that frame to the world.
        for k in range(6):
            of_com = k < 2  # horizontally the centre of mass is controlled, else the base
            velocity = (
                reference.com_velocity_in_support[row, k] if of_com else reference.qvel[row, k]
            )
            lead[k] = (
                reference.com_acceleration_in_support[row, k] if of_com else reference.qacc[row, k]
            )
            lead[k] += scale[k] * action[i, k] + damping[k] * velocity
            if k < 3:
                place = reference.com_in_support[row, k] if of_com else reference.qpos[row, k]
                lead[k] += stiffness[k] * place
        for k in range(3):
            place = terms.com[i, k] if k < 2 else terms.base_position[i, k]
            rate = terms.com_velocity[i, k] if k < 2 else state.qvel[i, k]
            result[i, k] = dot(level[k], lead[:3])
            result[i, k] -= stiffness[k] * (place - frame.centre[i, k]) + damping[k] * rate
        for k in range(3, 6):
            result[i, k] = lead[k] + stiffness[k] * axial[k - 3] - damping[k] * state.qvel[i, k]
        for k in range(6, size):
            result[i, k] = (
                reference.qacc[row, k]
                + gains.posture_stiffness * (reference.qpos[row, k + 1] - state.qpos[i, k + 1])
                + gains.posture_damping * (reference.qvel[row, k] - state.qvel[i, k])
            )
    return result


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
