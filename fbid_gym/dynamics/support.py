"""Where the feet stand: the level frame in which "hold the home posture" has a meaning."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.contacts import ContactGeometry, point_positions
from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.robots import Robot

# (cosine, sine) @ _HEADING + _UP is the rotation about the vertical, row by row.
_HEADING = np.array([[1.0, 0, 0, 0, 1, 0, 0, 0, 0], [0.0, -1, 0, 1, 0, 0, 0, 0, 0]])
_UP = np.array([0.0, 0, 0, 0, 0, 0, 0, 0, 1])


class SupportFrame(NamedTuple):
    """The level frame of N robots' feet.

    Attributes:
        centre: (N, 3) m, world, the mean of the contact points.
        rotation: (N, 3, 3) world from support: z up, x the feet's forward direction.
    """

    centre: np.ndarray
    rotation: np.ndarray


@dataclass(frozen=True, eq=False)
class Support:
    """A robot's home stance, seen from its feet; F feet.

    The forward direction of the feet is the heading for which the contact points, seen from above,
    lie nearest to where they are in the home stance (planar Procrustes).

    Attributes:
        centre: (F,) weights of the foot references in the centre of the contact points.
        by_position: (3F, 2) and
        by_rotation: (9F, 2): linear maps from the feet's poses to the heading's cosine and sine,
            up to a common factor.
        home_base: (3,) m, base from the centre of the contact points at home.
        home_com: (3,) m, centre of mass from the same.
        home_base_rotation: (3, 3) of the base at home.
        margin: (2,) m, forward and sideways: distance the centre of pressure can move from below
            the home centre of mass before it leaves the contact points, the shorter way.
        radius: m, mean horizontal distance of the contact points from their centre.
    """

    centre: np.ndarray
    by_position: np.ndarray
    by_rotation: np.ndarray
    home_base: np.ndarray
    home_com: np.ndarray
    home_base_rotation: np.ndarray
    margin: np.ndarray
    radius: float

    @classmethod
    def of(cls, robot: Robot) -> "Support":
        """Measure the home stance of a robot."""
        geometry = ContactGeometry.of(robot)
        qpos = robot.home_qpos[None]
        terms = MuJoCoDynamics(robot).terms(qpos, np.zeros((1, robot.nv)))
        points = point_positions(geometry, terms)[0]
        centre = points.mean(axis=0)
        layout = (points - centre)[:, :2]

        num_feet = len(robot.feet)
        weights = np.bincount(geometry.foot_of_point, minlength=num_feet) / len(points)
        # cos: sum_i layout_i . d_i; sin: sum_i layout_i × d_i, with d_i the point from the centre,
        # d_i = foot position + foot rotation @ offset_i - centre.
        turned = np.stack([-layout[:, 1], layout[:, 0]], axis=1)
        by_position = np.zeros((num_feet, 3, 2))
        by_rotation = np.zeros((num_feet, 3, 3, 2))
        for foot, offset, *pairs in zip(
            geometry.foot_of_point, geometry.offset, layout, turned, strict=True
        ):
            for column, pair in enumerate(pairs):
                by_position[foot, :2, column] += pair
                by_rotation[foot, :2, :, column] += pair[:, None] * offset
        com = terms.com[0] - centre
        ahead, behind = layout.max(axis=0) - com[:2], com[:2] - layout.min(axis=0)
        return cls(
            centre=weights,
            by_position=by_position.reshape(-1, 2),
            by_rotation=by_rotation.reshape(-1, 2),
            home_base=terms.base_position[0] - centre,
            home_com=com,
            home_base_rotation=terms.base_rotation[0],
            margin=np.maximum(np.minimum(ahead, behind), 0.0),
            radius=float(np.linalg.norm(layout, axis=1).mean()),
        )

    def frame(self, terms: DynamicsTerms) -> SupportFrame:
        """Return the level frame of the feet of N robots."""
        num_robots = len(terms.foot_position)
        centre = self.centre @ terms.foot_position
        # vecmat and not @: it rounds each robot's row the same, however many robots there are.
        heading = np.vecmat(terms.foot_position.reshape(num_robots, -1), self.by_position)
        heading += np.vecmat(terms.foot_rotation.reshape(num_robots, -1), self.by_rotation)
        # A layout with no extent (one point) has no heading of its own: keep the world's.
        heading[:, 0] += 1e-12
        heading /= np.sqrt(np.vecdot(heading, heading))[:, None]
        rotation = (heading @ _HEADING + _UP).reshape(num_robots, 3, 3)
        return SupportFrame(centre, rotation)
