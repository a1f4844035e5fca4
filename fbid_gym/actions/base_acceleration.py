"""Layer `base_acceleration`: a task-space stabiliser of the base, to which the action adds."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.acceleration_law import DIAGNOSTICS, AccelerationLaw
from fbid_gym.actions.contact_options import CONTACT_DEFAULTS, ContactOptions
from fbid_gym.actions.layer import Memory
from fbid_gym.actions.options import positive
from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.dynamics.state import RobotState
from fbid_gym.dynamics.support import Support
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.motions import Reference
from fbid_gym.robots import Robot

_VERTICAL_SCALE = 0.5  # of gravity: half the weight more, or half less
# vee @ vec(A): the axial vector of a 3×3 matrix, (A - A^T) / 2 = skew(axial).
_AXIAL = np.zeros((9, 3))
_AXIAL[[7, 2, 3], [0, 1, 2]] = 0.5
_AXIAL[[5, 6, 1], [0, 1, 2]] = -0.5


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
        support: the home stance.
        stiffness: (6,) w^2 of the base, 1/s^2.
        damping: (6,) 2 zeta w of the base, 1/s.
        posture_stiffness: w^2 of the joints, 1/s^2.
        posture_damping: 2 zeta w of the joints, 1/s.
        scale: (6,) m/s^2 and rad/s^2 at action 1.
    """

    law: AccelerationLaw
    support: Support
    stiffness: np.ndarray
    damping: np.ndarray
    posture_stiffness: float
    posture_damping: float
    scale: np.ndarray

    @classmethod
    def of(
        cls,
        robot: Robot,
        control_hz: int,
        *,
        balance_frequency: float = 1.0,
        height_frequency: float = 1.2,
        rotation_frequency: float = 1.2,
        posture_frequency: float = 1.0,
        damping_ratio: float = 1.0,
        base_priority: float = 1e3,
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
        positive(
            balance_frequency=balance_frequency,
            height_frequency=height_frequency,
            rotation_frequency=rotation_frequency,
            posture_frequency=posture_frequency,
            damping_ratio=damping_ratio,
            base_priority=base_priority,
        )
        law = AccelerationLaw.of(robot, control_hz, contact, base_priority=base_priority)
        support = Support.of(robot)
        omega = (
            2.0
            * np.pi
            * np.array([balance_frequency] * 2 + [height_frequency] + [rotation_frequency] * 3)
        )
        posture = 2.0 * np.pi * posture_frequency
        return cls(
            law=law,
            support=support,
            stiffness=omega**2,
            damping=2.0 * damping_ratio * omega,
            posture_stiffness=posture**2,
            posture_damping=2.0 * damping_ratio * posture,
            scale=_scale(robot, support, contact.friction),
        )

    @property
    def action_names(self) -> tuple[str, ...]:
        """Six accelerations of the base."""
        names = [f"base acceleration {axis}, support frame" for axis in "xyz"]
        names += [f"base angular acceleration {axis}, base frame" for axis in "xyz"]
        units = ["m/s^2"] * 3 + ["rad/s^2"] * 3
        return tuple(
            f"{name} (x {scale:.3g} {unit})"
            for name, scale, unit in zip(names, self.scale, units, strict=True)
        )

    @property
    def diagnostics(self) -> tuple[str, ...]:
        """Of the acceleration law."""
        return DIAGNOSTICS

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
        velocity = state.qvel
        frame = self.support.frame(terms)
        num_robots = len(velocity)
        rate = np.concatenate([terms.com_velocity[:, :2], velocity[:, 2:6]], axis=1)
        point = terms.com - frame.centre
        point[:, 2] += terms.base_position[:, 2] - terms.com[:, 2]
        wanted = frame.rotation @ quaternion_to_matrix(reference.qpos[:, 3:7])
        turn = terms.base_rotation.swapaxes(1, 2) @ wanted

        # The gains are the same along x and y, so they commute with the turn about the vertical
        # from the support frame to the world.
        push = self.scale * action + _steered(reference.qacc, reference.com_acceleration)
        push += self.damping * _steered(reference.qvel, reference.com_velocity)
        push[:, :3] += self.stiffness[:3] * _steered(reference.qpos, reference.com)[:, :3]
        out = np.empty_like(velocity)
        out[:, :3] = np.matvec(frame.rotation, push[:, :3]) - self.stiffness[:3] * point
        out[:, 3:6] = push[:, 3:] + self.stiffness[3:] * (turn.reshape(num_robots, 9) @ _AXIAL)
        out[:, :6] -= self.damping * rate
        out[:, 6:] = (
            reference.qacc[:, 6:]
            + self.posture_stiffness * (reference.qpos[:, 7:] - state.qpos[:, 7:])
            + self.posture_damping * (reference.qvel[:, 6:] - velocity[:, 6:])
        )
        return out


def _steered(base: np.ndarray, com: np.ndarray) -> np.ndarray:
    """The six controlled coordinates: centre of mass in x and y, then those of the base."""
    return np.concatenate([com[:, :2], base[:, 2:6]], axis=1)


def _scale(robot: Robot, support: Support, friction: float) -> np.ndarray:
    """What action 1 means, see `BaseAcceleration`: (6,) m/s^2 and rad/s^2."""
    gravity = robot.weight / robot.mass
    terms = MuJoCoDynamics(robot).terms(robot.home_qpos[None], np.zeros((1, robot.nv)))
    inertia = np.diag(terms.mass_matrix[0])[3:6]
    margin = support.margin
    linear = np.minimum(gravity * margin / support.home_com[2], friction * gravity)
    tilting = robot.weight * margin[::-1]  # a sideways shift rolls, a forward shift pitches
    turning = friction * robot.weight * support.radius
    moment = np.append(tilting, turning)
    return np.concatenate([linear, [_VERTICAL_SCALE * gravity], moment / inertia])
