"""What every task sees of a robot, and when it takes it for fallen."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.contacts import ContactGeometry, point_velocities
from fbid_gym.dynamics.state import Outcome
from fbid_gym.dynamics.support import Support
from fbid_gym.robots import Robot
from fbid_gym.small_matrices import dot

FALLEN_HEIGHT = 0.6
"""Share of the home height below which the robot counts as fallen."""

FALLEN_TILT = 60.0
"""Tilt of the base (degrees) beyond which the robot counts as fallen."""

TOUCH = 0.01
"""Share of the robot's weight that a point must carry to count as in contact."""

_LEAST_UPRIGHT = np.cos(np.radians(FALLEN_TILT))

# Names of the entries that come before the joints, by their largest size.
_BASE = {
    10.0: tuple(f"base {axis} from home (m, support frame)" for axis in "xyz"),
    1.0: tuple(f"up direction {axis} (base frame)" for axis in "xyz"),
    100.0: (
        *(f"base velocity {axis} (m/s, support frame)" for axis in "xyz"),
        *(f"base angular velocity {axis} (rad/s, base frame)" for axis in "xyz"),
    ),
}


class Posture(NamedTuple):
    """How N robots stand; P points.

    Attributes:
        base: (N, 3) m, where each base is in its support frame.
        velocity: (N, 3) m/s, of the base along the axes of that frame.
        upright: (N,) cosine of the angle between the base's up direction and the vertical. The
            base's up direction is that which points up at home.
        touching: (N, P) bool, which points carry weight.
        slip: (N,) m/s, mean speed of the points on the ground.
    """

    base: np.ndarray
    velocity: np.ndarray
    upright: np.ndarray
    touching: np.ndarray
    slip: np.ndarray


@dataclass(frozen=True, eq=False)
class Body:
    """A robot as its tasks see it.

    Attributes:
        robot: the robot.
        support: its home stance.
        geometry: of its contact points.
    """

    robot: Robot
    support: Support
    geometry: ContactGeometry

    @classmethod
    def of(cls, robot: Robot) -> "Body":
        """Measure a robot's home stance."""
        return cls(robot, Support.of(robot), ContactGeometry.of(robot))

    @cached_property
    def home_height(self) -> float:
        """Height of the base above its feet at home, m."""
        return float(self.support.home_base[2])

    @cached_property
    def home_up(self) -> np.ndarray:
        """What points up at home, (3,), in the base's axes."""
        return self.support.home_base_rotation[2].copy()

    @cached_property
    def weight(self) -> float:
        """Weight in N."""
        return self.robot.weight

    @cached_property
    def mean_torque_limit(self) -> float:
        """Mean of the joints' torque limits, N·m."""
        return float(self.robot.torque_limit.mean())

    @property
    def observation_names(self) -> tuple[str, ...]:
        """One name per entry of `observe`."""
        joints, points = self.robot.joint_names, self.geometry.num_points
        return (
            *(name for names in _BASE.values() for name in names),
            *(f"{joint} position from home (rad)" for joint in joints),
            *(f"{joint} velocity (rad/s)" for joint in joints),
            *(f"{joint} last torque (share of its limit)" for joint in joints),
            *(f"normal force on point {point} (share of the weight)" for point in range(points)),
        )

    @property
    def observation_bound(self) -> np.ndarray:
        """Largest size of each entry of `observe`."""
        joints, points = self.robot.num_joints, self.geometry.num_points
        return np.concatenate(
            [
                *(np.full(len(names), size) for size, names in _BASE.items()),
                np.full(joints, 10.0),
                np.full(joints, 100.0),
                np.ones(joints),
                np.full(points, 100.0),
            ]
        )

    def posture(self, outcome: Outcome) -> Posture:
        """Return how the robots stand."""
        terms, count = outcome.terms, len(outcome.torque)
        posture = Posture(
            base=np.empty((count, 3)),
            velocity=np.empty((count, 3)),
            upright=np.empty(count),
            touching=np.empty((count, self.geometry.num_points), bool),
            slip=np.empty(count),
        )
        qvel, contact_force = map(np.ascontiguousarray, outcome.state[1:3])
        _measure(
            *outcome.frame,
            *(terms.base_position, terms.base_rotation, qvel, self.home_up, contact_force),
            *(TOUCH * self.weight, point_velocities(self.geometry, terms)),
            *posture,
        )
        return posture

    def observe(self, outcome: Outcome) -> np.ndarray:
        """Return the posture, its velocity, the last torques and the load on the feet: (N, O)."""
        robot, terms = self.robot, outcome.terms
        qpos, qvel, contact_force = map(np.ascontiguousarray, outcome.state[:3])
        count, joints, points = contact_force.shape[0], robot.num_joints, contact_force.shape[1]
        seen = np.empty((count, 12 + 3 * joints + points))
        _observe(
            *outcome.frame,
            *(terms.base_position, terms.base_rotation, qpos, qvel, contact_force),
            *(outcome.torque, self.support.home_base, robot.home_qpos, robot.torque_limit),
            *(self.weight, seen),
        )
        return seen

    def fallen(self, outcome: Outcome) -> np.ndarray:
        """Return which robots lie: (N,) bool."""
        terms, lying = outcome.terms, np.empty(len(outcome.torque), bool)
        low = FALLEN_HEIGHT * self.home_height
        places = terms.base_position, terms.base_rotation, outcome.frame.centre
        _find_fallen(*places, self.home_up, low, _LEAST_UPRIGHT, lying)
        return lying


@kernel
def _measure(
    centre: np.ndarray,
    heading: np.ndarray,
    base_position: np.ndarray,
    base_rotation: np.ndarray,
    qvel: np.ndarray,
    home_up: np.ndarray,
    contact_force: np.ndarray,
    touch: float,
    point_velocity: np.ndarray,
    base: np.ndarray,
    velocity: np.ndarray,
    upright: np.ndarray,
    touching: np.ndarray,
    slip: np.ndarray,
) -> None:
    """Fill the last five, a `Posture`.

    Args:
        centre: (N, 3) m and
        heading: (N, 3, 3), of `SupportFrame`.
        base_position: (N, 3) m and
        base_rotation: (N, 3, 3), of `DynamicsTerms`.
        qvel: (N, nv).
        home_up: (3,) what points up at home, in the base's axes.
        contact_force: (N, P, 3) N.
        touch: N that a point must carry to count as in contact.
        point_velocity: (N, P, 3) m/s.
        base: (N, 3) m, and the rest: see `Posture`.
        velocity: see there.
        upright: see there.
        touching: see there.
        slip: see there.
    """
    points = touching.shape[1]
    for i in range(len(base)):
        for k in range(3):
            base[i, k], velocity[i, k] = 0.0, 0.0
            for axis in range(3):
                offset = base_position[i, axis] - centre[i, axis]
                base[i, k] += heading[i, axis, k] * offset
                velocity[i, k] += heading[i, axis, k] * qvel[i, axis]
        upright[i] = dot(base_rotation[i, 2], home_up)
        total, down = 0.0, 0
        for point in range(points):
            touching[i, point] = contact_force[i, point, 2] > touch
            if touching[i, point]:
                moving = point_velocity[i, point]
                total += np.sqrt(dot(moving, moving))
                down += 1
        slip[i] = total / max(down, 1)


@kernel
def _observe(
    centre: np.ndarray,
    heading: np.ndarray,
    base_position: np.ndarray,
    base_rotation: np.ndarray,
    qpos: np.ndarray,
    qvel: np.ndarray,
    contact_force: np.ndarray,
    torque: np.ndarray,
    home_base: np.ndarray,
    home_qpos: np.ndarray,
    torque_limit: np.ndarray,
    weight: float,
    seen: np.ndarray,
) -> None:
    """Write what `Body.observe` returns; the arguments are those of outcome, robot and support."""
    joints = torque.shape[1]
    for i in range(len(seen)):
        for k in range(3):
            place, speed = 0.0, 0.0
            for axis in range(3):
                place += heading[i, axis, k] * (base_position[i, axis] - centre[i, axis])
                speed += heading[i, axis, k] * qvel[i, axis]
            seen[i, k] = place - home_base[k]
            seen[i, 3 + k] = base_rotation[i, 2, k]
            seen[i, 6 + k] = speed
            seen[i, 9 + k] = qvel[i, 3 + k]
        for j in range(joints):
            seen[i, 12 + j] = qpos[i, 7 + j] - home_qpos[7 + j]
            seen[i, 12 + joints + j] = qvel[i, 6 + j]
            seen[i, 12 + 2 * joints + j] = torque[i, j] / torque_limit[j]
        for point in range(contact_force.shape[1]):
            seen[i, 12 + 3 * joints + point] = contact_force[i, point, 2] / weight


@kernel
def _find_fallen(
    base_position: np.ndarray,
    base_rotation: np.ndarray,
    centre: np.ndarray,
    home_up: np.ndarray,
    low: float,
    least_upright: float,
    lying: np.ndarray,
) -> None:
    """Find the robots (N,) whose base is lower than `low` m above the feet, or not upright."""
    for i in range(len(lying)):
        height = base_position[i, 2] - centre[i, 2]
        lying[i] = height < low or dot(base_rotation[i, 2], home_up) < least_upright


def weighted(share: np.ndarray, weights: Mapping[str, float]) -> dict[str, np.ndarray]:
    """Return the terms of a reward, each (N,) in [0, its weight], from shares (K, N) in [0, 1]."""
    terms = share * np.fromiter(weights.values(), float, len(weights))[:, None]
    return dict(zip(weights, terms, strict=True))


@compiled
def bell(value: float, scale: float) -> float:
    """1 at zero, 1/e at `scale`."""
    return np.exp(-((value / scale) ** 2))


@compiled
def level(cosine: float) -> float:
    """1 at an angle of zero, 1/e at 0.2 rad."""
    return np.exp(-(1.0 - cosine) / (1.0 - np.cos(0.2)))
