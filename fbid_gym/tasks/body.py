"""What every task sees of a robot, and when it takes it for fallen."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fbid_gym.dynamics.contacts import ContactGeometry, point_velocities
from fbid_gym.dynamics.state import Outcome
from fbid_gym.dynamics.support import Support
from fbid_gym.robots import Robot

FALLEN_HEIGHT = 0.6
"""Share of the home height below which the robot counts as fallen."""

FALLEN_TILT = 60.0
"""Tilt of the base (degrees) beyond which the robot counts as fallen."""

TOUCH = 0.01
"""Share of the robot's weight that a point must carry to count as in contact."""

# Names of the entries that come before the joints, by their largest size.
_BASE = {
    10.0: tuple(f"base {axis} from home (m, support frame)" for axis in "xyz"),
    1.0: tuple(f"up direction {axis} (base frame)" for axis in "xyz"),
    100.0: (
        *(f"base velocity {axis} (m/s, support frame)" for axis in "xyz"),
        *(f"base angular velocity {axis} (rad/s, base frame)" for axis in "xyz"),
    ),
}


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

    @property
    def home_height(self) -> float:
        """Height of the base above its feet at home, m."""
        return float(self.support.home_base[2])

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

    def base(self, outcome: Outcome) -> np.ndarray:
        """Return where each base is, in its support frame: (N, 3) m."""
        offset = outcome.terms.base_position - outcome.frame.centre
        return np.vecmat(offset, outcome.frame.rotation)

    def observe(self, outcome: Outcome) -> np.ndarray:
        """Return the posture, its velocity, the last torques and the load on the feet: (N, O)."""
        robot, state = self.robot, outcome.state
        return np.concatenate(
            [
                self.base(outcome) - self.support.home_base,
                outcome.terms.base_rotation[:, 2],
                np.vecmat(state.qvel[:, :3], outcome.frame.rotation),
                state.qvel[:, 3:6],
                state.qpos[:, 7:] - robot.home_qpos[7:],
                state.qvel[:, 6:],
                outcome.torque / robot.torque_limit,
                state.contact_force[:, :, 2] / robot.weight,
            ],
            axis=1,
        )

    def touching(self, outcome: Outcome) -> np.ndarray:
        """Return which points carry weight: (N, P) bool."""
        return outcome.state.contact_force[:, :, 2] > TOUCH * self.robot.weight

    def slip(self, outcome: Outcome, touching: np.ndarray) -> np.ndarray:
        """Return the mean speed of the points on the ground: (N,) m/s."""
        velocity = point_velocities(self.geometry, outcome.terms)
        speed = np.sqrt(np.vecdot(velocity, velocity))
        return (speed * touching).sum(axis=1) / np.maximum(touching.sum(axis=1), 1)

    def upright(self, rotation: np.ndarray) -> np.ndarray:
        """Return the cosine of the angle between the base's up direction and the vertical: (N,).

        The base's up direction is that which points up at home.
        """
        return np.vecdot(rotation[:, 2], self.support.home_base_rotation[2])

    def fallen(self, outcome: Outcome) -> np.ndarray:
        """Return which robots lie: (N,) bool."""
        terms = outcome.terms
        height = terms.base_position[:, 2] - outcome.frame.centre[:, 2]
        low = height < FALLEN_HEIGHT * self.home_height
        return low | (self.upright(terms.base_rotation) < np.cos(np.radians(FALLEN_TILT)))


def weighted(
    share: Mapping[str, np.ndarray], weights: Mapping[str, float]
) -> dict[str, np.ndarray]:
    """Return the terms of a reward, each (N,) in [0, its weight], from shares in [0, 1]."""
    return {name: weights[name] * value for name, value in share.items()}


def bell(value: np.ndarray, scale: float) -> np.ndarray:
    """1 at zero, 1/e at `scale`."""
    return np.exp(-np.square(value / scale))
