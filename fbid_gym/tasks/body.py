"""What every task sees of a robot, and when it takes it for fallen."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import bind, compiled, kernel
from fbid_gym.dynamics.contacts import point_velocities
from fbid_gym.dynamics.stance import Stance
from fbid_gym.dynamics.support import support_frame
from fbid_gym.quantities import ContactGeometry, DynamicsTerms, Heading, RobotState
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import dot
from fbid_gym.tasks.outcome import Outcome, Posture

FALLEN_HEIGHT = 0.6
"""Share of how tall its task has it stand, `Body.size` less `Body.lowered`, below which what is as
high at home counts as fallen."""

FALLEN_TILT = 60.0
"""Tilt of the base (degrees) beyond which the robot counts as fallen."""

TOUCHING_LOAD = 0.01
"""Share of the robot's weight that a point must carry to count as in contact."""

_LEAST_UPRIGHT = float(np.cos(np.radians(FALLEN_TILT)))


class _Seen(NamedTuple):
    """What is seen of N robots whose feet are the frame, in the order of the observation."""

    base: np.ndarray  # (N, 3) m, from home, support frame
    up: np.ndarray  # (N, 3) the vertical, base frame
    velocity: np.ndarray  # (N, 3) m/s, of the base, support frame
    angular_velocity: np.ndarray  # (N, 3) rad/s, base frame


class _Limbs(NamedTuple):
    """What every task sees of the limbs of N robots, likewise."""

    joint_position: np.ndarray  # (N, n) rad, from home
    joint_velocity: np.ndarray  # (N, n) rad/s
    torque: np.ndarray  # (N, n) last one, share of its limit
    load: np.ndarray  # (N, P) normal force, share of the weight


class BodyConstants(NamedTuple):
    """What posture and observation are measured by, see `Body`."""

    geometry: ContactGeometry
    heading: Heading
    touching_force: float  # N, of a point that counts as in contact
    home_base: np.ndarray
    home_qpos: np.ndarray
    torque_limit: np.ndarray
    weight: float


@dataclass(frozen=True, eq=False)
class Body:
    """A robot as its tasks see it.

    Attributes:
        robot: the robot.
        stance: it at home.
        lowered: m, most by which the task has it walk lower than it stands at home.
    """

    robot: Robot
    stance: Stance
    lowered: float

    @classmethod
    def of(cls, robot: Robot, lowered: float = 0.0) -> "Body":
        """Measure a robot's home stance; `lowered` as above."""
        return cls(robot, Stance.of(robot), lowered)

    @cached_property
    def home_height(self) -> float:
        """Height of the base above its feet at home, m."""
        return float(self.stance.home_base[2])

    @property
    def size(self) -> float:
        """How tall the robot stands, m: `Stance.size`, what lengths are measured by."""
        return self.stance.size

    @cached_property
    def speed(self) -> float:
        """What makes speeds of robots of all sizes comparable: sqrt(g * size), m/s."""
        return float(np.sqrt(self.robot.gravity * self.size))

    def height(self, share: np.ndarray) -> np.ndarray:
        """Return the height of a base, m, that is lower than at home as a robot of a share is."""
        return self.size * share + (self.home_height - self.size)

    @cached_property
    def mean_torque_limit(self) -> float:
        """Mean of the joints' torque limits, N·m."""
        return float(self.robot.torque_limit.mean())

    @cached_property
    def constants(self) -> BodyConstants:
        """What posture and observation are measured by."""
        robot, stance = self.robot, self.stance
        return BodyConstants(
            geometry=stance.geometry,
            heading=stance.heading,
            touching_force=TOUCHING_LOAD * robot.weight,
            home_base=stance.home_base,
            home_qpos=robot.home_qpos,
            torque_limit=robot.torque_limit,
            weight=robot.weight,
        )

    @property
    def observation_names(self) -> tuple[str, ...]:
        """One name per entry of `observe`."""
        return (
            *(f"base {axis} from home (m, support frame)" for axis in "xyz"),
            *(f"up direction {axis} (base frame)" for axis in "xyz"),
            *(f"base velocity {axis} (m/s, support frame)" for axis in "xyz"),
            *(f"base angular velocity {axis} (rad/s, base frame)" for axis in "xyz"),
            *self.limb_names,
        )

    @property
    def limb_names(self) -> tuple[str, ...]:
        """One name per entry of `see_limbs`."""
        joints, points = self.robot.joint_names, self.robot.num_points
        return (
            *(f"{joint} position from home (rad)" for joint in joints),
            *(f"{joint} velocity (rad/s)" for joint in joints),
            *(f"{joint} last torque (share of its limit)" for joint in joints),
            *(f"normal force on point {point} (share of the weight)" for point in range(points)),
        )

    @property
    def observation_bound(self) -> np.ndarray:
        """Largest size of each entry of `observe`."""
        axes = np.ones(3)
        bound = _Seen(
            base=10.0 * axes,
            up=axes,
            velocity=100.0 * axes,
            angular_velocity=100.0 * axes,
        )
        return np.concatenate([*bound, self.limb_bound])

    @property
    def limb_bound(self) -> np.ndarray:
        """Largest size of each entry of `see_limbs`."""
        joints, points = np.ones(self.robot.num_joints), np.ones(self.robot.num_points)
        bound = _Limbs(
            joint_position=10.0 * joints,
            joint_velocity=100.0 * joints,
            torque=joints,
            load=100.0 * points,
        )
        return np.concatenate(bound)

    def posture(self, state: RobotState, terms: DynamicsTerms) -> Posture:
        """Return how robots stand."""
        return self._measure(state, terms)

    def observe(self, outcome: Outcome) -> np.ndarray:
        """Return the posture, its velocity, the last torques and the load on the feet: (N, O)."""
        return self._see(outcome)

    @cached_property
    def _measure(self) -> Callable[..., Posture]:
        return bind(_measure, self.constants)

    @cached_property
    def _see(self) -> Callable[..., np.ndarray]:
        return bind(see_body, self.constants)

    def fallen(self, outcome: Outcome) -> np.ndarray:
        """Return which robots lie: (N,) bool."""
        return self._find_fallen(outcome.posture)

    @cached_property
    def _find_fallen(self) -> Callable[..., np.ndarray]:
        low = FALLEN_HEIGHT * (self.size - self.lowered)
        return bind(_find_fallen, self.size - self.home_height, low)


@kernel
def _measure(body: BodyConstants, state: RobotState, terms: DynamicsTerms) -> Posture:
    """What `Body.posture` returns."""
    frame, (count, points) = support_frame(body.heading, terms), state.contact_force.shape[:2]
    point_velocity = point_velocities(body.geometry, terms)
    base, velocity, upright = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
    touching, slip = np.empty((count, points), np.bool_), np.empty(count)
    for i in range(count):
        for k in range(3):
            base[i, k], velocity[i, k] = 0.0, 0.0
            for axis in range(3):
                offset = terms.base_position[i, axis] - frame.centre[i, axis]
                base[i, k] += frame.world_from_support[i, axis, k] * offset
                velocity[i, k] += frame.world_from_support[i, axis, k] * state.qvel[i, axis]
        upright[i] = terms.world_from_trunk[i, 2, 2]
        total, down = 0.0, 0
        for point in range(points):
            touching[i, point] = state.contact_force[i, point, 2] > body.touching_force
            if touching[i, point]:
                moving = point_velocity[i, point]
                total += np.sqrt(dot(moving, moving))
                down += 1
        slip[i] = total / max(down, 1)
    return Posture(base, velocity, upright, touching, slip)


@kernel
def _find_fallen(above: float, low: float, posture: Posture) -> np.ndarray:
    """What `Body.fallen` returns: whose top, so far `above` the base (m), is lower than `low`."""
    fallen = np.empty(len(posture.upright), np.bool_)
    for i in range(len(fallen)):
        upright = posture.upright[i]
        fallen[i] = posture.base[i, 2] + above * upright < low or upright < _LEAST_UPRIGHT
    return fallen


@kernel
def see_body(body: BodyConstants, outcome: Outcome) -> np.ndarray:
    """What `Body.observe` returns."""
    state, terms, posture = outcome.state, outcome.terms, outcome.posture
    count = len(state.qpos)
    seen = _Seen(
        np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    )
    for i in range(count):
        for k in range(3):
            seen.base[i, k] = posture.base[i, k] - body.home_base[k]
            seen.up[i, k] = terms.world_from_base[i, 2, k]
            seen.velocity[i, k] = posture.velocity[i, k]
            seen.angular_velocity[i, k] = state.qvel[i, 3 + k]
    limbs = see_limbs(body.home_qpos, body.torque_limit, body.weight, outcome)
    return side_by_side((side_by_side(seen), limbs))


@compiled
def see_limbs(
    home_qpos: np.ndarray, torque_limit: np.ndarray, weight: float, outcome: Outcome
) -> np.ndarray:
    """What every task sees of joints and contact points: (N, 3 n + P), named by `limb_names`.

    Args:
        home_qpos: (nq,).
        torque_limit: (n,) N·m.
        weight: N.
        outcome: of the robots.
    """
    state = outcome.state
    (count, joints), points = outcome.torque.shape, state.contact_force.shape[1]
    seen = _Limbs(
        np.empty((count, joints)),
        np.empty((count, joints)),
        np.empty((count, joints)),
        np.empty((count, points)),
    )
    for i in range(count):
        for j in range(joints):
            seen.joint_position[i, j] = state.qpos[i, 7 + j] - home_qpos[7 + j]
            seen.joint_velocity[i, j] = state.qvel[i, 6 + j]
            seen.torque[i, j] = outcome.torque[i, j] / torque_limit[j]
        for point in range(points):
            seen.load[i, point] = state.contact_force[i, point, 2] / weight
    return side_by_side(seen)


@compiled
def side_by_side(parts: tuple[np.ndarray, ...]) -> np.ndarray:
    """Return arrays (N, a), (N, b), ... side by side: (N, a + b + ...)."""
    width = 0
    for part in parts:
        width += part.shape[1]
    joined, first = np.empty((len(parts[0]), width)), 0
    for part in parts:
        for i in range(len(part)):
            for j in range(part.shape[1]):
                joined[i, first + j] = part[i, j]
        first += part.shape[1]
    return joined


@compiled
def weigh(shares: tuple[np.ndarray, ...], weights: tuple[float, ...]) -> None:
    """Turn shares (N,) in [0, 1] of the terms of a reward into these, each in [0, its weight]."""
    for k in range(len(weights)):
        share, weight = shares[k], weights[k]
        for i in range(len(share)):
            share[i] *= weight


@compiled
def bell(value: float, scale: float) -> float:
    """1 at zero, 1/e at `scale`."""
    return np.exp(-((value / scale) ** 2))


@compiled
def level(cosine: float) -> float:
    """1 at an angle of zero, 1/e at 0.2 rad."""
    return np.exp(-(1.0 - cosine) / (1.0 - np.cos(0.2)))
