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

from fbid_gym.compiled import kernel
from fbid_gym.dynamics.frames import skew
from fbid_gym.dynamics.terms import DynamicsTerms
from fbid_gym.dynamics.vectors import add, cross, dot, matrix, store, turn, vector
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
        every: (1, P) all points active.
    """

    foot_of_point: np.ndarray
    slot_of_point: np.ndarray
    offset: np.ndarray
    motion: np.ndarray
    spread: np.ndarray
    every: np.ndarray

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
            every=np.ones((1, sum(sizes)), bool),
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
    positions = np.empty((len(terms.foot_position), geometry.num_points, 3))
    _place(
        geometry.foot_of_point,
        geometry.offset,
        terms.foot_position,
        terms.foot_rotation,
        positions,
    )
    return positions


@kernel
def _place(
    foot_of_point: np.ndarray,
    offset: np.ndarray,
    foot_position: np.ndarray,
    foot_rotation: np.ndarray,
    positions: np.ndarray,
) -> None:
    """Fill positions (N, P, 3)."""
    for i in range(len(positions)):
        for point in range(len(offset)):
            foot = foot_of_point[point]
            arm = turn(matrix(foot_rotation, (i, foot)), vector(offset, (point,)))
            store(add(vector(foot_position, (i, foot)), arm), positions, (i, point))


def point_velocities(geometry: ContactGeometry, terms: DynamicsTerms) -> np.ndarray:
    """Return how fast the contact points move: (N, P, 3) m/s, world."""
    velocities = np.empty((len(terms.foot_velocity), geometry.num_points, 3))
    _move(
        geometry.foot_of_point,
        geometry.offset,
        terms.foot_rotation,
        terms.foot_velocity,
        velocities,
    )
    return velocities


@kernel
def _move(
    foot_of_point: np.ndarray,
    offset: np.ndarray,
    foot_rotation: np.ndarray,
    foot_velocity: np.ndarray,
    velocities: np.ndarray,
) -> None:
    """Fill velocities (N, P, 3)."""
    for i in range(len(velocities)):
        for point in range(len(offset)):
            foot = foot_of_point[point]
            arm = turn(matrix(foot_rotation, (i, foot)), vector(offset, (point,)))
            linear, omega = vector(foot_velocity, (i, foot)), vector(foot_velocity, (i, foot), 3)
            store(add(linear, cross(omega, arm)), velocities, (i, point))


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
    num_robots, _, _, nv = terms.foot_jacobian.shape
    if active is None:
        turning, points = False, geometry.every
    else:
        if active.shape != (num_robots, geometry.num_points):
            raise ShapeError("active", active.shape, f"({num_robots}, {geometry.num_points})")
        turning, points = True, np.ascontiguousarray(active, bool)
    rows = geometry.num_rows
    contacts = ReducedContacts(
        np.empty((num_robots, rows, nv)),
        np.empty((num_robots, rows)),
        np.empty((num_robots, rows, 3 * geometry.num_points)),
    )
    fill_contacts(
        geometry.foot_of_point,
        geometry.slot_of_point,
        geometry.offset,
        geometry.motion,
        geometry.spread,
        turning,
        points,
        terms.foot_rotation,
        terms.foot_velocity,
        terms.foot_jacobian,
        terms.foot_bias,
        *contacts,
    )
    return contacts


@kernel
def fill_contacts(
    foot_of_point: np.ndarray,
    slot_of_point: np.ndarray,
    offset: np.ndarray,
    motion: np.ndarray,
    spread: np.ndarray,
    turning: bool,
    active: np.ndarray,
    foot_rotation: np.ndarray,
    foot_velocity: np.ndarray,
    foot_jacobian: np.ndarray,
    foot_bias: np.ndarray,
    jacobian: np.ndarray,
    bias: np.ndarray,
    point_map: np.ndarray,
) -> None:
    """Fill the reduced contacts; `turning`: feet may turn about some of their points."""
    num_feet, _, rows, _ = motion.shape
    subset = np.empty(num_feet, np.int64)
    for i in range(len(jacobian)):
        subset[:] = 0
        for point in range(len(offset)):
            if active[min(i, len(active) - 1), point]:
                subset[foot_of_point[point]] |= 1 << slot_of_point[point]

        # Both factors act on vectors in the foot's axes: bring them to the world's.
        for foot in range(num_feet):
            rotation = matrix(foot_rotation, (i, foot))
            rate, spin = vector(foot_bias, (i, foot)), vector(foot_bias, (i, foot), 3)
            for row in range(rows):
                factor = (foot, subset[foot], row)
                linear = turn(rotation, vector(motion, factor))
                angular = turn(rotation, vector(motion, factor, 3))
                k = foot * rows + row
                for j in range(jacobian.shape[2]):
                    jacobian[i, k, j] = (
                        linear[0] * foot_jacobian[i, foot, 0, j]
                        + linear[1] * foot_jacobian[i, foot, 1, j]
                        + linear[2] * foot_jacobian[i, foot, 2, j]
                        + angular[0] * foot_jacobian[i, foot, 3, j]
                        + angular[1] * foot_jacobian[i, foot, 4, j]
                        + angular[2] * foot_jacobian[i, foot, 5, j]
                    )
                bias[i, k] = dot(linear, rate) + dot(angular, spin)

        for k in range(point_map.shape[1]):
            for column in range(point_map.shape[2]):
                point_map[i, k, column] = 0.0
        for point in range(len(offset)):
            foot = foot_of_point[point]
            rotation = matrix(foot_rotation, (i, foot))
            # With all of a foot's points on the ground, their acceleration about its reference
            # vanishes or the rows cannot see it.
            arm, omega = (
                turn(rotation, vector(offset, (point,))),
                vector(foot_velocity, (i, foot), 3),
            )
            centripetal = cross(omega, cross(omega, arm))
            for row in range(rows):
                factor = (foot, subset[foot], row)
                force = turn(rotation, vector(spread, factor, 3 * slot_of_point[point]))
                k = foot * rows + row
                store(force, point_map, (i, k), 3 * point)
                if turning:
                    bias[i, k] += dot(force, centripetal)
