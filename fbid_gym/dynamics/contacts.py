"""What the feet's contact points do to the dynamics: point Jacobians, and the same in fewer rows.

A foot is rigid, so the velocities of its P contact points are P × 3 numbers that hold at most six
independent ones. `ContactGeometry` factors that fact once and for all: for every foot and every
subset of its points that may be in contact, the point velocities in the foot's axes are

    points = U (S [v; omega]),   U orthonormal columns, S of full row rank r <= 6,

with v and omega the velocity of the foot's reference. The rows S J_foot then stand for the active
points in every equation of [M10]: same rank, same null space, same minimum-norm solutions, and a
point force f acts through U^T f. Four corner points become 6 rows instead of 12.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.frames import skew
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.errors import ShapeError
from fbid_gym.robots import Robot

_RANK_TOLERANCE = 1e-6


class ReducedContacts(NamedTuple):
    """The active contact points of N robots in k rows; P points.

    Attributes:
        jacobian: (N, k, nv). Zero rows where a foot has fewer active directions than k allows.
        bias: (N, k) m/s^2, "Jdot v" of the same rows.
        point_map: (N, k, 3P) takes stacked point forces (world axes) to the rows, so that
            J_points^T f = jacobian^T (point_map f). Zero columns for inactive points.
    """

    jacobian: np.ndarray
    bias: np.ndarray
    point_map: np.ndarray


@dataclass(frozen=True, eq=False)
class ContactGeometry:
    """The constant part of a robot's contacts; F feet, P points, at most p of them on one foot.

    Attributes:
        foot_of_point: (P,) which foot a point belongs to.
        slot_of_point: (P,) its place among the foot's points, in 0 … p - 1.
        offset: (P, 3) m from the foot's reference, in the foot's axes.
        motion: (F, 2^p, r, 6) the matrix S for every subset of active points.
        spread: (F, 2^p, r, 3p) the matrix U^T; columns of inactive points are zero.
    """

    foot_of_point: np.ndarray
    slot_of_point: np.ndarray
    offset: np.ndarray
    motion: np.ndarray
    spread: np.ndarray

    @classmethod
    def of(cls, robot: Robot) -> "ContactGeometry":
        """Factor the contact geometry of a robot."""
        sizes = [len(foot.points) for foot in robot.feet]
        most = max(sizes)
        offsets = [foot.points - foot.points.mean(axis=0) for foot in robot.feet]
        factors = [
            [_factor(offset, subset, most) for subset in range(2**most)] for offset in offsets
        ]
        rows = max(len(motion) for foot in factors for motion, _ in foot)
        motion = np.zeros((len(sizes), 2**most, rows, 6))
        spread = np.zeros((len(sizes), 2**most, rows, 3 * most))
        for foot, subsets in enumerate(factors):
            for subset, (motion_rows, spread_rows) in enumerate(subsets):
                motion[foot, subset, : len(motion_rows)] = motion_rows
                spread[foot, subset, : len(spread_rows)] = spread_rows
        return cls(
            foot_of_point=np.repeat(np.arange(len(sizes)), sizes),
            slot_of_point=np.concatenate([np.arange(size) for size in sizes]),
            offset=np.concatenate(offsets),
            motion=motion,
            spread=spread,
        )

    @property
    def num_points(self) -> int:
        """Number of contact points P."""
        return len(self.offset)

    @property
    def num_rows(self) -> int:
        """Number of rows k of the reduced contacts."""
        return self.motion.shape[0] * self.motion.shape[2]


def _factor(offset: np.ndarray, subset: int, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Factor the map from a foot's velocity to those of its points in `subset` (a bit mask)."""
    points = np.zeros((most, 3, 6))
    for slot, arm in enumerate(offset):
        if subset >> slot & 1:
            points[slot, :, :3] = np.eye(3)
            points[slot, :, 3:] = -skew(arm)
    left, sizes, right = np.linalg.svd(points.reshape(3 * most, 6), full_matrices=False)
    rank = int((sizes > _RANK_TOLERANCE * max(1.0, sizes[0])).sum())
    return sizes[:rank, None] * right[:rank], left[:, :rank].T


def point_positions(geometry: ContactGeometry, terms: DynamicsTerms) -> np.ndarray:
    """Return where the contact points are: (N, P, 3) m, world."""
    foot = geometry.foot_of_point
    arm = np.matvec(terms.foot_rotation[:, foot], geometry.offset)
    return terms.foot_position[:, foot] + arm


def point_velocities(geometry: ContactGeometry, terms: DynamicsTerms) -> np.ndarray:
    """Return how fast the contact points move: (N, P, 3) m/s, world."""
    foot = geometry.foot_of_point
    velocity = terms.foot_velocity.take(foot, axis=1)
    arm = np.matvec(terms.foot_rotation.take(foot, axis=1), geometry.offset)
    return velocity[..., :3] + np.matvec(skew(velocity[..., 3:]), arm)


def point_jacobian(
    geometry: ContactGeometry, terms: DynamicsTerms
) -> tuple[np.ndarray, np.ndarray]:
    """Return the Jacobian of all contact points and its bias.

    Returns:
        J: (N, 3P, nv), three rows a point, world axes.
        Jdot_v: (N, 3P) m/s^2.
    """
    foot = geometry.foot_of_point
    arm = np.matvec(terms.foot_rotation[:, foot], geometry.offset)
    foot_jacobian = terms.foot_jacobian[:, foot]
    # v_point = v + omega × arm, column by column of the Jacobian.
    jacobian = foot_jacobian[:, :, :3] - skew(arm) @ foot_jacobian[:, :, 3:]
    spin, rate = skew(terms.foot_velocity[:, foot, 3:]), terms.foot_bias[:, foot]
    bias = rate[..., :3] + np.matvec(skew(rate[..., 3:]), arm)
    bias += np.matvec(spin, np.matvec(spin, arm))
    num_robots = len(arm)
    return jacobian.reshape(num_robots, -1, jacobian.shape[-1]), bias.reshape(num_robots, -1)


def reduced_contacts(
    geometry: ContactGeometry, terms: DynamicsTerms, active: np.ndarray | None = None
) -> ReducedContacts:
    """Return the active contact points in as few rows as the feet's geometry allows.

    Args:
        geometry: the robot's contacts.
        terms: the dynamics of N robots.
        active: (N, P) bool, which points are in contact; all if None.

    Raises:
        ShapeError: `active` has another shape.
    """
    num_robots, num_feet = terms.foot_position.shape[:2]
    rows, slots = geometry.spread.shape[2], geometry.spread.shape[3] // 3
    if active is None:
        full = (1 << np.bincount(geometry.foot_of_point)) - 1
        motion = geometry.motion[np.arange(num_feet), full]
        spread = geometry.spread[np.arange(num_feet), full]
    else:
        if active.shape != (num_robots, geometry.num_points):
            raise ShapeError("active", active.shape, f"({num_robots}, {geometry.num_points})")
        bits = np.zeros((num_robots, num_feet, slots), int)
        bits[:, geometry.foot_of_point, geometry.slot_of_point] = active
        subset = bits @ (1 << np.arange(slots))
        motion = geometry.motion[np.arange(num_feet), subset]
        spread = geometry.spread[np.arange(num_feet), subset]

    # Both factors act on vectors in the foot's axes: bring them to the world's.
    to_foot = terms.foot_rotation.swapaxes(-1, -2)
    shape = (num_robots, num_feet, rows)
    motion = (motion.reshape(*motion.shape[:-2], 2 * rows, 3) @ to_foot).reshape(*shape, 6)
    spread = (spread.reshape(*spread.shape[:-2], rows * slots, 3) @ to_foot).reshape(*shape, -1)

    jacobian = (motion @ terms.foot_jacobian).reshape(num_robots, num_feet * rows, -1)
    bias = np.matvec(motion, terms.foot_bias)
    if active is not None:
        bias += np.matvec(spread, _centripetal(geometry, terms, slots))
    point_map = np.zeros((num_robots, num_feet, rows, num_feet, 3 * slots))
    feet = np.arange(num_feet)
    point_map[:, feet, :, feet] = spread.swapaxes(0, 1)
    point_map = point_map.reshape(num_robots, num_feet * rows, -1)
    if num_feet * slots != geometry.num_points:
        column = 3 * (geometry.foot_of_point * slots + geometry.slot_of_point)
        point_map = point_map[:, :, (column[:, None] + np.arange(3)).ravel()]
    return ReducedContacts(jacobian, bias.reshape(num_robots, -1), point_map)


def _centripetal(geometry: ContactGeometry, terms: DynamicsTerms, slots: int) -> np.ndarray:
    """Acceleration omega × (omega × arm) of the points, by foot: (N, F, 3p) m/s^2.

    With all of a foot's points on the ground it vanishes or the rows cannot see it, so it is needed
    only where a foot may turn about some of its points.
    """
    foot = geometry.foot_of_point
    arm = np.matvec(terms.foot_rotation[:, foot], geometry.offset)
    omega = terms.foot_velocity[:, foot, 3:]
    along = (omega * arm).sum(axis=-1, keepdims=True)
    square = (omega * omega).sum(axis=-1, keepdims=True)
    num_robots, num_feet = terms.foot_position.shape[:2]
    out = np.zeros((num_robots, num_feet, slots, 3))
    out[:, foot, geometry.slot_of_point] = omega * along - square * arm
    return out.reshape(num_robots, num_feet, -1)
