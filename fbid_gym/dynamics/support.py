"""Where the feet stand: the level frame in which "hold the home posture" has a meaning."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.dynamics.contacts import ContactGeometry, point_positions
from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.robots import Robot


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
        return cls(
            centre=weights,
            by_position=by_position.reshape(-1, 2),
            by_rotation=by_rotation.reshape(-1, 2),
            home_base=terms.base_position[0] - centre,
            home_com=com,
            home_base_rotation=terms.base_rotation[0],
            margin=np.array([_margin(layout - com[:2], axis) for axis in range(2)]),
            radius=float(np.linalg.norm(layout, axis=1).mean()),
        )

    def frame(self, terms: DynamicsTerms) -> SupportFrame:
        """Return the level frame of the feet of N robots."""
        count = len(terms.foot_position)
        frame = SupportFrame(np.empty((count, 3)), np.empty((count, 3, 3)))
        fill_frame(
            self.centre,
            self.by_position,
            self.by_rotation,
            terms.foot_position,
            terms.foot_rotation,
            *frame,
        )
        return frame


def _margin(points: np.ndarray, axis: int) -> float:
    """How far the origin can move along an axis, either way, within the hull of points (P, 2).

    The hull's edges join two points each, and no other two are joined farther out: the line along
    the axis leaves the hull at the outermost of its crossings with what joins any two points.
    """
    along, across = points[:, axis], points[:, 1 - axis]
    i, j = np.nonzero(across[:, None] * across < 0.0)
    between = (across[j] * along[i] - across[i] * along[j]) / (across[j] - across[i])
    met = np.concatenate([along[across == 0.0], between])
    return max(float(min(met.max(), -met.min())), 0.0) if met.size else 0.0


@kernel
def fill_frame(
    weight: np.ndarray,
    by_position: np.ndarray,
    by_rotation: np.ndarray,
    foot_position: np.ndarray,
    foot_rotation: np.ndarray,
    centre: np.ndarray,
    rotation: np.ndarray,
) -> None:
    """Fill the frames; `weight` of each foot in the centre, the rest as in `Support`."""
    for i in range(len(centre)):
        centre[i] = 0.0
        # A layout with no extent (one point) has no heading of its own: keep the world's.
        cosine, sine = 1e-12, 0.0
        for foot in range(len(weight)):
            for axis in range(3):
                place = foot_position[i, foot, axis]
                centre[i, axis] += weight[foot] * place
                cosine += place * by_position[3 * foot + axis, 0]
                sine += place * by_position[3 * foot + axis, 1]
                for along in range(3):
                    entry, row = foot_rotation[i, foot, axis, along], 3 * (3 * foot + axis) + along
                    cosine += entry * by_rotation[row, 0]
                    sine += entry * by_rotation[row, 1]
        size = np.sqrt(cosine**2 + sine**2)
        cosine, sine = cosine / size, sine / size
        rotation[i] = 0.0
        rotation[i, 0, 0] = rotation[i, 1, 1] = cosine
        rotation[i, 0, 1], rotation[i, 1, 0] = -sine, sine
        rotation[i, 2, 2] = 1.0
