"""Constraints of the feet's contact points: point Jacobians, and the same in fewer rows.

A foot is rigid, so the velocities of its P contact points are P × 3 numbers that hold at most six
independent ones. `ContactGeometry` factors that fact once and for all: for every foot and every
subset of its points that may be in contact, the point velocities in the foot's axes are

    points = U (S [v; omega]),   U orthonormal columns, S of full row rank r <= 6,

with v and omega the velocity of the foot's reference. The rows S J_foot then stand for the active
points in every equation of [M10]: same rank, same null space, same minimum-norm solutions, and a
point force f acts through U^T f. Four corner points become 6 rows instead of 12.
"""

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.dynamics.vectors import add, cross, dot, matrix, store, turn, vector
from fbid_gym.errors import ShapeError
from fbid_gym.quantities import ContactGeometry, DynamicsTerms, ReducedContacts
from fbid_gym.robots import Robot

_RANK_TOLERANCE = 1e-6


def contact_geometry(robot: Robot, *, share: float = 1.0) -> ContactGeometry:
    """Factor the contact geometry of a robot.

    Args:
        robot: whose feet.
        share: of their size; below 1 the points lie nearer to the middle of their foot.
    """
    sizes = [len(foot.points) for foot in robot.feet]
    most = max(sizes)
    offsets = [share * (foot.points - foot.points.mean(axis=0)) for foot in robot.feet]
    factors = [[_factor(offset, subset, most) for subset in range(2**most)] for offset in offsets]
    rows = max(len(motion) for foot in factors for motion, _ in foot)
    motion = np.zeros((len(sizes), 2**most, rows, 6))
    spread = np.zeros((len(sizes), 2**most, rows, 3 * most))
    for foot, subsets in enumerate(factors):
        for subset, (motion_rows, spread_rows) in enumerate(subsets):
            motion[foot, subset, : len(motion_rows)] = motion_rows
            spread[foot, subset, : len(spread_rows)] = spread_rows
    return ContactGeometry(
        foot_of_point=np.repeat(np.arange(len(sizes)), sizes),
        slot_of_point=np.concatenate([np.arange(size) for size in sizes]),
        offset=np.concatenate(offsets),
        motion=motion,
        spread=spread,
    )


def _factor(offset: np.ndarray, subset: int, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Factor the map from a foot's velocity to those of its points in `subset` (a bit mask)."""
    points = np.zeros((most, 3, 6))
    for slot, arm in enumerate(offset):
        if subset >> slot & 1:
            points[slot, :, :3] = np.eye(3)
            points[slot, :, 3:] = np.cross(arm, np.eye(3))
    left, sizes, right = np.linalg.svd(points.reshape(3 * most, 6), full_matrices=False)
    rank = int((sizes > _RANK_TOLERANCE * max(1.0, sizes[0])).sum())
    return sizes[:rank, None] * right[:rank], left[:, :rank].T


@kernel
def point_positions(geometry: ContactGeometry, terms: DynamicsTerms) -> np.ndarray:
    """Return where the contact points are: (N, P, 3) m, world."""
    count, points = len(terms.foot_position), len(geometry.offset)
    positions = np.empty((count, points, 3))
    for i in range(count):
        for point in range(points):
            foot = geometry.foot_of_point[point]
            arm = turn(matrix(terms.world_from_foot, (i, foot)), vector(geometry.offset, (point,)))
            store(add(vector(terms.foot_position, (i, foot)), arm), positions, (i, point))
    return positions


@kernel
def point_velocities(geometry: ContactGeometry, terms: DynamicsTerms) -> np.ndarray:
    """Return how fast the contact points move: (N, P, 3) m/s, world."""
    count, points = len(terms.foot_velocity), len(geometry.offset)
    velocities = np.empty((count, points, 3))
    for i in range(count):
        for point in range(points):
            foot = geometry.foot_of_point[point]
            arm = turn(matrix(terms.world_from_foot, (i, foot)), vector(geometry.offset, (point,)))
            linear = vector(terms.foot_velocity, (i, foot))
            omega = vector(terms.foot_velocity, (i, foot), 3)
            store(add(linear, cross(omega, arm)), velocities, (i, point))
    return velocities


def point_jacobian(
    geometry: ContactGeometry, terms: DynamicsTerms
) -> tuple[np.ndarray, np.ndarray]:
    """Return the Jacobian of all contact points and its bias.

    Returns:
        J: (N, 3P, nv), three rows a point, world axes.
        Jdot_v: (N, 3P) m/s^2.
    """
    foot = geometry.foot_of_point
    arm = np.matvec(terms.world_from_foot[:, foot], geometry.offset)
    foot_jacobian = terms.foot_jacobian[:, foot]
    # v_point = v + omega × arm, column by column of the Jacobian.
    jacobian = foot_jacobian[:, :, :3] - np.cross(arm[..., None], foot_jacobian[:, :, 3:], axis=2)
    spin, rate = terms.foot_velocity[:, foot, 3:], terms.foot_bias[:, foot]
    bias = rate[..., :3] + np.cross(rate[..., 3:], arm) + np.cross(spin, np.cross(spin, arm))
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
    expected = (len(terms.foot_jacobian), geometry.num_points)
    if active is not None and active.shape != expected:
        raise ShapeError("active", active.shape, f"{expected}")
    mask = np.empty((0, expected[1])) if active is None else active
    return reduce_contacts(geometry, np.ascontiguousarray(mask, bool), terms)


@kernel
def reduce_contacts(
    geometry: ContactGeometry, active: np.ndarray, terms: DynamicsTerms
) -> ReducedContacts:
    """Return the active points in as few rows as the feet's geometry allows.

    These are (N, P) bool, or (0, P) where all are on the ground and stay there.
    """
    count, _, _, nv = terms.foot_jacobian.shape
    num_feet, _, rows, _ = geometry.motion.shape
    points = len(geometry.offset)
    jacobian, bias = np.empty((count, num_feet * rows, nv)), np.empty((count, num_feet * rows))
    point_map = np.empty((count, num_feet * rows, 3 * points))
    subset = np.empty(num_feet, np.int64)
    for i in range(count):
        subset[:] = 0
        for point in range(points):
            if len(active) == 0 or active[i, point]:
                subset[geometry.foot_of_point[point]] |= 1 << geometry.slot_of_point[point]

        # Both factors act on vectors in the foot's axes: bring them to the world's.
        for foot in range(num_feet):
            rotation = matrix(terms.world_from_foot, (i, foot))
            rate, spin = vector(terms.foot_bias, (i, foot)), vector(terms.foot_bias, (i, foot), 3)
            for row in range(rows):
                factor = (foot, subset[foot], row)
                linear = turn(rotation, vector(geometry.motion, factor))
                angular = turn(rotation, vector(geometry.motion, factor, 3))
                k = foot * rows + row
                for j in range(nv):
                    jacobian[i, k, j] = (
                        linear[0] * terms.foot_jacobian[i, foot, 0, j]
                        + linear[1] * terms.foot_jacobian[i, foot, 1, j]
                        + linear[2] * terms.foot_jacobian[i, foot, 2, j]
                        + angular[0] * terms.foot_jacobian[i, foot, 3, j]
                        + angular[1] * terms.foot_jacobian[i, foot, 4, j]
                        + angular[2] * terms.foot_jacobian[i, foot, 5, j]
                    )
                bias[i, k] = dot(linear, rate) + dot(angular, spin)

        for k in range(point_map.shape[1]):
            for column in range(point_map.shape[2]):
                point_map[i, k, column] = 0.0
        for point in range(points):
            foot = geometry.foot_of_point[point]
            rotation = matrix(terms.world_from_foot, (i, foot))
            arm = turn(rotation, vector(geometry.offset, (point,)))
            omega = vector(terms.foot_velocity, (i, foot), 3)
            centripetal = cross(omega, cross(omega, arm))
            for row in range(rows):
                factor = (foot, subset[foot], row)
                force = turn(
                    rotation, vector(geometry.spread, factor, 3 * geometry.slot_of_point[point])
                )
                k = foot * rows + row
                store(force, point_map, (i, k), 3 * point)
                # With all of a foot's points on the ground, their acceleration about its reference
                # vanishes or the rows cannot see it.
                if len(active) > 0:
                    bias[i, k] += dot(force, centripetal)
    return ReducedContacts(jacobian, bias, point_map)
