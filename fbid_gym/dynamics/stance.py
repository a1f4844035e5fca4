"""A robot's home stance, measured once: what stabilisers, gains and scales are derived from."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.contacts import contact_geometry, point_positions
from fbid_gym.dynamics.mujoco_dynamics import MuJoCoDynamics
from fbid_gym.dynamics.support import heading_of, support_frame
from fbid_gym.quantities import ContactGeometry, DynamicsTerms, Heading, SupportFrame
from fbid_gym.robots import Robot
from fbid_gym.robots.measured import once_for_robot


class Limbs(NamedTuple):
    """The joints that move each foot; F feet. Joints are coordinates, 6 … nv - 1.

    Attributes:
        size: nv.
        legs: (F, K) int64, joints that move this foot and no other; -1 beyond the last.
        others: (A,) int64, joints that move no foot, or several.
        shared: int64, those of them that move several.
        rows: (F,) int64, how many rows of its Jacobian hold a foot with all its points: the first
            three, or all six; 0 where it takes others.
        every: (F,) int64, the set of all its points, as bits.
        able: (F,) bool, whether its own joints are at least as many as these rows.
        turns: (F, 3, 3) axes, in the foot's own, about which its joints can turn a foot that is
            held in place; rows of zeros where there are too few of them.
    """

    size: int
    legs: np.ndarray
    others: np.ndarray
    shared: np.ndarray
    rows: np.ndarray
    every: np.ndarray
    able: np.ndarray
    turns: np.ndarray


@dataclass(frozen=True, eq=False)
class Stance:
    """A robot that stands at home, at rest; P points, F feet.

    Attributes:
        geometry: of its contacts.
        hips: (F, 3) m, world, where the first joint of each foot's leg has its axis; of a foot
            without joints of its own, where that is.
        heading: finds the level frame of its feet.
        terms: of its dynamics, in one row.
        home_base: (3,) m, base from the centre of the contact points.
        home_com: (3,) m, centre of mass from the same.
        falling_rate: 1/s, sqrt(g / height of the centre of mass).
        layout: (P, 2) m, contact points from their centre, seen from above.
        legs: (F, n) bool, joints that move this foot and no other.
    """

    geometry: ContactGeometry
    hips: np.ndarray
    heading: Heading
    terms: DynamicsTerms
    home_base: np.ndarray
    home_com: np.ndarray
    falling_rate: float
    layout: np.ndarray
    legs: np.ndarray

    @staticmethod
    @once_for_robot
    def of(robot: Robot) -> "Stance":
        """Measure the home stance of a robot; once for each."""
        geometry = contact_geometry(robot)
        terms = MuJoCoDynamics(robot).terms(robot.home_qpos[None], np.zeros((1, robot.nv)))
        moves = _moves(terms)
        legs = moves & (moves.sum(axis=0) == 1)
        points = point_positions(geometry, terms)[0]
        centre = points.mean(axis=0)
        layout = (points - centre)[:, :2]
        home_com = terms.com[0] - centre
        return Stance(
            geometry=geometry,
            hips=_hips(robot, terms, legs),
            heading=heading_of(geometry, layout),
            terms=terms,
            home_base=terms.base_position[0] - centre,
            home_com=home_com,
            falling_rate=float(np.sqrt(robot.gravity / home_com[2])),
            layout=layout,
            legs=legs,
        )

    @cached_property
    def size(self) -> float:
        """Height above the feet, m, of the hips, or of the centre of mass if higher.

        Wherever in its body the base has its origin.
        """
        ground = self.terms.base_position[0, 2] - self.home_base[2]
        return float(max(self.hips[:, 2].max() - ground, self.home_com[2]))

    @property
    def margin(self) -> np.ndarray:
        """(2,) m, forward and sideways: how far the centre of pressure can move.

        From below the centre of mass until it leaves the contact points, the shorter way.
        """
        return np.array([_margin(self.layout - self.home_com[:2], axis) for axis in range(2)])

    @property
    def radius(self) -> float:
        """Mean horizontal distance of the contact points from their centre, m."""
        return float(np.linalg.norm(self.layout, axis=1).mean())

    @property
    def length(self) -> float:
        """m, lever arm that makes moments on the robot comparable to forces."""
        return self.radius or 1.0

    def mobility(self, base_priority: float) -> np.ndarray:
        """Return how readily each coordinate departs from its desired acceleration: (nv,).

        One over its weight in "nearest": `base_priority` for the base, one for the joints. The
        base's position counts in heights of the centre of mass, so that no unit matters.
        """
        mobility = np.ones(self.terms.mass_matrix.shape[1])
        mobility[:6] /= base_priority
        mobility[:3] *= self.home_com[2] ** 2
        return mobility

    @cached_property
    def standing_inertia(self) -> np.ndarray:
        """Inertia each joint moves while its own foot stays put: (n,) kg·m².

        A leg's joint that turns by itself swings everything beyond it about its axis; with the foot
        on the ground that is the rest of the robot. The feet share the load, hence the division by
        their number. A joint that no foot hangs from moves what it carries, its diagonal entry of
        M.
        """
        matrix, feet = self.terms.mass_matrix[0], self.terms.foot_jacobian[0]
        inertia = np.diag(matrix)[6:].copy()
        for jacobian in feet:
            for joint in np.flatnonzero(np.abs(jacobian[:, 6:]).max(axis=0) > 0.0):
                velocity = np.zeros(len(matrix))
                velocity[6 + joint] = 1.0
                # The base moves so that the foot does not.
                velocity[:6] = np.linalg.solve(jacobian[:, :6], -jacobian[:, 6 + joint])
                inertia[joint] = velocity @ matrix @ velocity / len(feet)
        return inertia

    @cached_property
    def limbs(self) -> Limbs:
        """The joints that move each foot."""
        legs, moves = self.legs, _moves(self.terms).sum(axis=0)
        own = np.full((len(legs), max(1, legs.sum(axis=1).max())), -1, np.int64)
        for row, leg in zip(own, legs, strict=True):
            row[: leg.sum()] = 6 + np.flatnonzero(leg)
        every = 2 ** np.bincount(self.geometry.foot_of_point, minlength=len(legs)) - 1
        ranks = [
            int((np.abs(self.geometry.motion[foot, points]).max(axis=1) > 0.0).sum())
            for foot, points in enumerate(every)
        ]
        return Limbs(
            size=6 + len(moves),
            legs=own,
            others=6 + np.flatnonzero(moves != 1),
            shared=6 + np.flatnonzero(moves > 1),
            rows=np.array([rank if rank in (3, 6) else 0 for rank in ranks], np.int64),
            every=every.astype(np.int64),
            able=legs.sum(axis=1) >= ranks,
            turns=np.array([_turns(self.terms, foot, leg) for foot, leg in enumerate(legs)]),
        )

    def frame(self, terms: DynamicsTerms) -> SupportFrame:
        """Return the level frame of the feet of N robots."""
        return support_frame(self.heading, terms)


def _turns(terms: DynamicsTerms, foot: int, leg: np.ndarray) -> np.ndarray:
    """Axes (3, 3), in those of a foot, about which the joints of a leg (n,) bool can turn it."""
    place, spin = np.split(terms.foot_jacobian[0, foot][:, 6:][:, leg], 2)
    free = spin - spin @ np.linalg.pinv(place, rcond=1e-6) @ place
    axes, _, _ = np.linalg.svd(terms.world_from_foot[0, foot].T @ free)
    most = max(0, min(3, int(leg.sum()) - 3))
    return np.where(np.arange(3)[:, None] < most, axes.T, 0.0) if most < 3 else np.eye(3)


def _moves(terms: DynamicsTerms) -> np.ndarray:
    """Tell which joint moves which foot: (F, n) bool."""
    return np.asarray(np.abs(terms.foot_jacobian[0, :, :, 6:]).max(axis=1) > 0.0)


def _hips(robot: Robot, terms: DynamicsTerms, legs: np.ndarray) -> np.ndarray:
    data = robot.at_home.data
    hips = terms.foot_position[0].copy()
    for foot, leg in enumerate(legs):
        if leg.any():
            hips[foot] = data.xanchor[robot.model.dof_jntid[6 + np.flatnonzero(leg)[0]]]
    return hips


def _margin(points: np.ndarray, axis: int) -> float:
    """Find how far the origin can move along an axis, either way, in the hull of points (P, 2).

    The hull's edges join two points each, and no other two are joined farther out: the line along
    the axis leaves the hull at the outermost of its crossings with what joins any two points.
    """
    along, across = points[:, axis], points[:, 1 - axis]
    i, j = np.nonzero(across[:, None] * across < 0.0)
    between = (across[j] * along[i] - across[i] * along[j]) / (across[j] - across[i])
    met = np.concatenate([along[across == 0.0], between])
    return max(float(min(met.max(), -met.min())), 0.0) if met.size else 0.0
