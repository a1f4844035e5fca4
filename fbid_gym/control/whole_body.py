"""Whole-body inverse dynamics, leg by leg: feet first, the body in what they leave, then the rest.

Each foot shall have an acceleration, B u + L q + Jdot v = c, with u of the base and q of the joints
that move this foot alone. Legs share nothing but the base, so these joints follow it:

    q = offset + follow u,    follow = -W L^T G^-1 B,    G = L W L^T + ridge,
    offset = r + W L^T G^-1 (c - Jdot v - L r),

where r are the accelerations that the robot stays near to and W how readily joints depart from
them. What is left is a problem in u, the six numbers of the base, and in the joints that move no
foot; those that move several have their r. A task of the body is served there by the least motion,
of the base in the metric

    S = W_u^-1 + sum over feet of B^T G^-1 B.

This is [M10] eq. (19), contacts before task before reference, as `operational_space` has it for any
robot: the same motion wherever the six can do what feet and body shall, on legs without joints to
spare. A leg of more joints than its foot has rows moves by itself for no task. Where they cannot:

- A leg that cannot move its standing foot in a direction (a straight knee, too few joints) is held
  by it: G keeps its ridge alone, and S holds the base there.
- A foot in the air is not turned in ways in which its leg has no joints to turn it (`Limbs.turns`),
  and is not worth a motion of the base then: it has no part in S.
- Directions of the task that the base can hardly move in fade out (`least_gain`).

Then come the forces on the contact points, within their limits, that best deliver the wrench on the
base, rows b of M a + h; the least motion that needs just what they deliver; and the joint torques
of M a + h - J^T f, as in `limited_inverse_dynamics`. Functions work on one robot, i, in buffers.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.control.dual_newton import Room, deliver_by_points, room_for
from fbid_gym.dynamics.stance import Limbs
from fbid_gym.dynamics.vectors import (
    NOTHING,
    Rotation,
    Vector,
    add,
    add_share,
    cross,
    matrix,
    product,
    six,
    store,
    store_six,
    subtract,
    transposed,
    turn,
    vector,
)
from fbid_gym.dynamics.vectors import dot as inner
from fbid_gym.quantities import Accuracy, ContactGeometry, DynamicsTerms
from fbid_gym.small_matrices import copy, dot, factor, solve_factored, trace_of_inverse

FREE, MOVES, STANDS = 0, 1, 2
"""What is asked of a foot: nothing, to move as told, or that its contact does not move."""

# Ridges on G, shares of the mean gain of a leg's joints on its foot: of a standing foot, and of one
# in the air.
_FIRM, _LOOSE = 1e-8, 1e-6
_FAR = 1e12  # of an eigenvalue that is never too small
_FAINT = 1e-3  # of the free robot's response: wrenches that the legs leave less of are given up
_LINE = 1e-3  # of the longest distance: points that lie nearer to a line are on it


class Feet(NamedTuple):
    """Commanded motion of the feet of N robots."""

    asked: np.ndarray  # (N, F) int64, `FREE`, `MOVES` or `STANDS`
    acceleration: np.ndarray  # (N, F, 6) m/s^2, rad/s^2, of their references
    active: np.ndarray  # (N, P) bool, points on the ground
    limits: np.ndarray  # (N, P, 3) friction coefficient, least and greatest normal force (N)


class MotionRows(NamedTuple):
    """A motion of one robot: accelerations, or velocities. Buffers."""

    asked: np.ndarray  # (F, R) c - Jdot v of the feet's rows; then less L r
    force: np.ndarray  # (F, R) G^-1 of that
    reference: np.ndarray  # (nv,) r, to stay near to; W_u^-1 r of the base counts
    offset: np.ndarray  # (F, K) of the legs' joints, see the module
    base: np.ndarray  # (6,) u
    others: np.ndarray  # (A,) of the joints that do not move one foot alone
    momentum: np.ndarray  # (6,) rows b of M times the motion
    whole: np.ndarray  # (nv,) of all coordinates


class Work(NamedTuple):
    """Buffers for the law on one robot: F legs of K joints, R rows a foot, P points."""

    by_base: np.ndarray  # (F, R, 6) B of the module
    by_leg: np.ndarray  # (F, R, K) L
    gain: np.ndarray  # (F, R, R) factors of G
    ridge: np.ndarray  # (F, R) on G
    weight: np.ndarray  # (F, K) W of the legs' joints; 0 where there is none
    mass: np.ndarray  # (F, 6, K) rows b of M, of the legs' joints
    spread: np.ndarray  # (F, R, 6) G^-1 B
    follow: np.ndarray  # (F, K, 6)
    metric: np.ndarray  # (6, 6) factors of S
    reach: np.ndarray  # (6, 6) rows b of M, per u with the legs following
    by_others: np.ndarray  # (6, A) rows b of M, of the other joints
    free: np.ndarray  # (A,) their W, 0 of those that move feet
    rows: np.ndarray  # (6, 6) of a task, per u
    other_rows: np.ndarray  # (6, A) likewise, per motion of the other joints
    columns: np.ndarray  # (6, 6) S^-1 rows^T
    gains: np.ndarray  # (6, 6) of the task, factored
    # (6,) what is left to do of the task, then S^-1 rows^T of it is the change of u.
    share: np.ndarray
    column: np.ndarray  # (6,) a buffer
    diagonal: np.ndarray  # (6,) a buffer
    arms: np.ndarray  # (P, 3) m, world, of the points on the ground from their foot's reference
    feet: np.ndarray  # (P,) int64, theirs
    forces: Room  # on these points


@compiled
def room_to_work(limbs: Limbs, geometry: ContactGeometry, mobility: np.ndarray) -> Work:
    """Return buffers for the law on one robot, its joints' part of `mobility` (nv,) among them."""
    feet, joints = limbs.legs.shape
    weight = np.zeros((feet, joints))
    for foot in range(feet):
        for k in range(joints):
            if limbs.legs[foot, k] >= 0:
                weight[foot, k] = mobility[limbs.legs[foot, k]]
    rows, points = geometry.motion.shape[2], len(geometry.offset)
    square, others = np.zeros((5, 6, 6)), len(limbs.others)
    free = np.zeros(others)
    for k in range(others):
        free[k] = mobility[limbs.others[k]]
        for j in range(len(limbs.shared)):
            if limbs.shared[j] == limbs.others[k]:
                free[k] = 0.0
    return Work(
        np.zeros((feet, rows, 6)),
        np.zeros((feet, rows, joints)),
        np.zeros((feet, rows, rows)),
        np.zeros((feet, rows)),
        weight,
        np.zeros((feet, 6, joints)),
        np.zeros((feet, rows, 6)),
        np.zeros((feet, joints, 6)),
        *(square[0], square[1], np.zeros((6, others)), free),
        *(square[2], np.zeros((6, others)), square[3], square[4]),
        *(np.empty(6), np.empty(6), np.empty(6)),
        np.empty((points, 3)),
        np.empty(points, np.int64),
        room_for(points),
    )


@compiled
def room_to_move(limbs: Limbs, geometry: ContactGeometry) -> MotionRows:
    """Return buffers for a motion of one robot."""
    feet, joints = limbs.legs.shape
    rows = geometry.motion.shape[2]
    return MotionRows(
        np.zeros((feet, rows)),
        np.zeros((feet, rows)),
        np.zeros(limbs.size),
        np.zeros((feet, joints)),
        np.zeros(6),
        np.zeros(len(limbs.others)),
        np.zeros(6),
        np.zeros(limbs.size),
    )


@compiled
def factor_legs(
    limbs: Limbs,
    geometry: ContactGeometry,
    mobility: np.ndarray,
    give: float,
    feet: Feet,
    terms: DynamicsTerms,
    i: int,
    work: Work,
    motion: MotionRows,
) -> None:
    """Have the legs follow the base, and read what is asked of the feet into `motion.asked`.

    The mobility (nv,) is W of the module; `give` is the ridge on G of standing feet on legs
    of too few joints, a share of its mean gain. What `work` has of legs, metric and reach is
    written; of the motion the reference is read.
    """
    metric, reach, mass_matrix = work.metric, work.reach, terms.mass_matrix[i]
    for row in range(6):
        store_six(NOTHING, metric, (row,))
        store_six(six(mass_matrix, (row,)), reach, (row,))
        metric[row, row] = 1.0 / mobility[row]
    for k in range(len(limbs.others)):
        for row in range(6):
            work.by_others[row, k] = mass_matrix[row, limbs.others[k]]
    for foot in range(len(limbs.legs)):
        by_leg, spread, follow = work.by_leg[foot], work.spread[foot], work.follow[foot]
        by_base, gain, mass = work.by_base[foot], work.gain[foot], work.mass[foot]
        if feet.asked[i, foot] == FREE:
            follow[:] = 0.0
            continue
        stands = feet.asked[i, foot] == STANDS
        _read_foot(limbs, geometry, feet, terms, i, foot, work, motion)
        share = _LOOSE if not stands else _FIRM if limbs.able[foot] else give
        _factor_leg(by_leg, work.weight[foot], share, gain, work.ridge[foot])
        counts = stands or limbs.able[foot]
        rows, joints = by_leg.shape
        # Sums of six in registers, and stored once: these are a third of the law's time.
        for row in range(rows):
            for column in range(6):
                spread[row, column] = by_base[row, column]
        _solve_six(gain, spread)
        for k in range(joints):
            sums = NOTHING
            for row in range(rows):
                sums = add_share(sums, -work.weight[foot, k] * by_leg[row, k], six(spread, (row,)))
            store_six(sums, follow, (k,))
        for row in range(6):
            sums = six(reach, (row,))
            for k in range(joints):
                sums = add_share(sums, mass[row, k], six(follow, (k,)))
            store_six(sums, reach, (row,))
            if counts:
                sums = six(metric, (row,))
                for k in range(rows):
                    sums = add_share(sums, by_base[k, row], six(spread, (k,)))
                store_six(sums, metric, (row,))
    factor(metric)


@compiled
def _factor_firm(matrix: np.ndarray, column: np.ndarray, diagonal: np.ndarray) -> None:
    """Overwrite the lower half of a symmetric matrix (6, 6) >= 0 with its factors.

    Of the matrix itself where the trace t of its inverse is below 1. Else 1 - 1/t is added to its
    diagonal first: that is continuous, and no eigenvalue ends below a half. `column` (6,) and
    `diagonal` (6,) are buffers; the upper half is overwritten.
    """
    for i in range(6):
        diagonal[i] = matrix[i, i]
        for j in range(i):
            matrix[j, i] = matrix[i, j]
    factor(matrix)
    trace = trace_of_inverse(matrix, column)
    if trace < 1.0:
        return
    # A matrix that rounding has made indefinite has no such trace.
    added = 1.0 - 1.0 / trace if trace < np.inf else 1.0
    for i in range(6):
        matrix[i, i] = diagonal[i] + added
        for j in range(i):
            matrix[i, j] = matrix[j, i]
    factor(matrix)


@compiled
def _solve_six(factors: np.ndarray, columns: np.ndarray) -> None:
    """Do the same as `solve_factored_columns`, faster: columns (a, 6) are of a known number."""
    size = len(columns)
    for i in range(size):
        sums = six(columns, (i,))
        for k in range(i):
            sums = add_share(sums, -factors[i, k], six(columns, (k,)))
        store_six(sums, columns, (i,))
    for i in range(size - 1, -1, -1):
        sums = add_share(NOTHING, factors[i, i], six(columns, (i,)))
        for k in range(i + 1, size):
            sums = add_share(sums, -factors[k, i], six(columns, (k,)))
        store_six(sums, columns, (i,))


@compiled
def _read_foot(
    limbs: Limbs,
    geometry: ContactGeometry,
    feet: Feet,
    terms: DynamicsTerms,
    i: int,
    foot: int,
    work: Work,
    motion: MotionRows,
) -> None:
    """Write the rows of a foot, and what is asked of them, c - Jdot v less what the others do."""
    by_base, by_leg, jacobian = work.by_base[foot], work.by_leg[foot], terms.foot_jacobian[i, foot]
    asked, every, mass = motion.asked[foot], limbs.every[foot], work.mass[foot]
    for k in range(by_leg.shape[1]):
        j = limbs.legs[foot, k]
        for row in range(6):
            mass[row, k] = terms.mass_matrix[i, row, j] if j >= 0 else 0.0
    subset = 0
    for point in range(len(geometry.offset)):
        if geometry.foot_of_point[point] == foot:
            if feet.active[i, point] or feet.asked[i, foot] == MOVES:
                subset |= 1 << geometry.slot_of_point[point]
    if subset == every and limbs.rows[foot] > 0:
        simple = limbs.rows[foot]
        for row in range(len(by_base)):
            there = row < simple
            for column in range(6):
                by_base[row, column] = jacobian[row, column] if there else 0.0
            for k in range(by_leg.shape[1]):
                j = limbs.legs[foot, k]
                by_leg[row, k] = jacobian[row, j] if there and j >= 0 else 0.0
            asked[row] = 0.0
            if there:
                asked[row] = feet.acceleration[i, foot, row] - terms.foot_bias[i, foot, row]
                for k in range(len(limbs.shared)):
                    j = limbs.shared[k]
                    asked[row] -= jacobian[row, j] * motion.reference[j]
        if feet.asked[i, foot] == MOVES and simple == 6 and not limbs.able[foot]:
            _turn_as_able(limbs, terms, i, foot, by_base, by_leg, asked)
        return
    rotation = matrix(terms.world_from_foot, (i, foot))
    linear = subtract(vector(feet.acceleration, (i, foot)), vector(terms.foot_bias, (i, foot)))
    angular = vector(feet.acceleration, (i, foot), 3)
    angular = subtract(angular, vector(terms.foot_bias, (i, foot), 3))
    for row in range(len(by_base)):
        place = turn(rotation, vector(geometry.motion, (foot, subset, row)))
        spin = turn(rotation, vector(geometry.motion, (foot, subset, row), 3))
        for column in range(6):
            by_base[row, column] = _along(place, spin, jacobian, column)
        for k in range(by_leg.shape[1]):
            j = limbs.legs[foot, k]
            by_leg[row, k] = _along(place, spin, jacobian, j) if j >= 0 else 0.0
        asked[row] = inner(place, linear) + inner(spin, angular)
        for k in range(len(limbs.shared)):
            j = limbs.shared[k]
            asked[row] -= _along(place, spin, jacobian, j) * motion.reference[j]
    # Points of a foot that turns about its edge are drawn towards its reference.
    omega = vector(terms.foot_velocity, (i, foot), 3)
    for point in range(len(geometry.offset)):
        if geometry.foot_of_point[point] == foot and subset >> geometry.slot_of_point[point] & 1:
            arm = turn(rotation, vector(geometry.offset, (point,)))
            drawn = cross(omega, cross(omega, arm))
            for row in range(len(by_base)):
                slot = 3 * geometry.slot_of_point[point]
                force = turn(rotation, vector(geometry.spread, (foot, subset, row), slot))
                asked[row] -= inner(force, drawn)


@compiled
def _turn_as_able(
    limbs: Limbs,
    terms: DynamicsTerms,
    i: int,
    foot: int,
    by_base: np.ndarray,
    by_leg: np.ndarray,
    asked: np.ndarray,
) -> None:
    """Replace the last three rows of a foot by rotations that its leg can give, else by zeros."""
    axes = product(
        matrix(limbs.turns, (foot,)), transposed(matrix(terms.world_from_foot, (i, foot)))
    )
    store(turn(axes, vector(asked, (), 3)), asked, (), 3)
    for column in range(6):
        _turn_column(axes, by_base, column)
    for k in range(by_leg.shape[1]):
        _turn_column(axes, by_leg, k)


@compiled
def _turn_column(axes: Rotation, rows: np.ndarray, column: int) -> None:
    """Overwrite rows[3:6, column] with axes times them."""
    turned = turn(axes, (rows[3, column], rows[4, column], rows[5, column]))
    rows[3, column], rows[4, column], rows[5, column] = turned


@compiled
def _along(place: Vector, spin: Vector, jacobian: np.ndarray, j: int) -> float:
    """A row of a foot's contact, of its Jacobian's column j."""
    linear = jacobian[0, j], jacobian[1, j], jacobian[2, j]
    return inner(place, linear) + inner(spin, (jacobian[3, j], jacobian[4, j], jacobian[5, j]))


@compiled
def _factor_leg(
    by_leg: np.ndarray, weight: np.ndarray, share: float, gain: np.ndarray, ridge: np.ndarray
) -> None:
    """Write the factors of G of one leg (R, R), and the ridge on G (R,), a `share` of its mean.

    Joints weigh `weight` (K,) of W.
    """
    rows, joints = by_leg.shape
    for row in range(rows):
        for column in range(row + 1):
            total = 0.0
            for k in range(joints):
                total += by_leg[row, k] * by_leg[column, k] * weight[k]
            gain[row, column] = total
    # Metres and radians apart, so that no unit matters; there are no more than three of the first.
    for first in range(0, rows, 3):
        last, mean = min(first + 3, rows), 0.0
        for row in range(first, last):
            mean += gain[row, row] / 3.0
        for row in range(first, last):
            # A row of zeros holds nothing.
            ridge[row] = share * mean if gain[row, row] > 0.0 else mean + 1.0
            gain[row, row] += ridge[row]
    factor(gain)


@compiled
def move_with_feet(
    limbs: Limbs,
    mobility: np.ndarray,
    feet: Feet,
    terms: DynamicsTerms,
    i: int,
    work: Work,
    motion: MotionRows,
) -> None:
    """Find the motion nearest to its reference that the feet allow: all but `whole`."""
    base, momentum = motion.base, motion.momentum
    for k in range(len(limbs.others)):
        motion.others[k] = motion.reference[limbs.others[k]]
    for row in range(6):
        base[row] = motion.reference[row] / mobility[row]
        momentum[row] = dot(work.by_others[row], motion.others)
    for foot in range(len(limbs.legs)):
        offset, asked, force = motion.offset[foot], motion.asked[foot], motion.force[foot]
        by_leg, mass = work.by_leg[foot], work.mass[foot]
        rows, joints = by_leg.shape
        for k in range(joints):
            j = limbs.legs[foot, k]
            offset[k] = motion.reference[j] if j >= 0 else 0.0
        if feet.asked[i, foot] != FREE:
            for row in range(rows):
                asked[row] -= dot(by_leg[row], offset)
            copy(asked, force)
            solve_factored(work.gain[foot], force)
            for k in range(joints):
                total = 0.0
                for row in range(rows):
                    total += by_leg[row, k] * force[row]
                offset[k] += work.weight[foot, k] * total
            if feet.asked[i, foot] == STANDS or limbs.able[foot]:
                sums = six(base, ())
                for row in range(rows):
                    sums = add_share(sums, asked[row], six(work.spread, (foot, row)))
                store_six(sums, base, ())
        else:
            for k in range(joints):
                j = limbs.legs[foot, k]
                for row in range(6):
                    mass[row, k] = terms.mass_matrix[i, row, j] if j >= 0 else 0.0
        for row in range(6):
            momentum[row] += dot(mass[row], offset)
    solve_factored(work.metric, base)
    for row in range(6):
        momentum[row] += dot(work.reach[row], base)


@compiled
def serve_body(size: int, least_gain: np.ndarray, work: Work, motion: MotionRows) -> None:
    """Change a motion, that is its base, others and momentum, by as little as a task takes.

    The task of the body has as many of `work.rows`, and of what is left to do, `work.share`, as its
    `size` says; rows, other rows and share are overwritten. `least_gain` (6,) is that of
    `operational_space`.
    """
    rows, columns, lower, share = work.rows, work.columns, work.gains, work.share
    other_rows, free = work.other_rows, work.free
    others = len(free)
    for row in range(6):
        worth = 1.0 / least_gain[row] if row < size else 0.0
        share[row] = worth * share[row] if row < size else 0.0
        for column in range(6):
            rows[row, column] *= worth
            columns[column, row] = rows[row, column]
        for k in range(others):
            other_rows[row, k] *= worth
    _solve_six(work.metric, columns)
    for row in range(6):
        sums = NOTHING
        for column in range(6):
            sums = add_share(sums, rows[row, column], six(columns, (column,)))
        store_six(sums, lower, (row,))
        for other in range(row + 1):
            for k in range(others):
                lower[row, other] += other_rows[row, k] * other_rows[other, k] * free[k]
        if row >= size:
            # It is not asked for: nothing is left to do there.
            lower[row, row] = _FAR
    _factor_firm(lower, work.column, work.diagonal)
    solve_factored(lower, share)
    for column in range(6):
        change = 0.0
        for row in range(6):
            change += columns[column, row] * share[row]
        motion.base[column] += change
        for row in range(6):
            motion.momentum[row] += work.reach[row, column] * change
    for k in range(others):
        change = 0.0
        for row in range(size):
            change += other_rows[row, k] * share[row]
        motion.others[k] += free[k] * change
        for row in range(6):
            motion.momentum[row] += work.by_others[row, k] * free[k] * change


@compiled
def put_together(limbs: Limbs, work: Work, motion: MotionRows) -> None:
    """Write `motion.whole` from its parts."""
    whole = motion.whole
    for column in range(6):
        whole[column] = motion.base[column]
    for k in range(len(limbs.others)):
        whole[limbs.others[k]] = motion.others[k]
    for foot in range(len(limbs.legs)):
        for k in range(limbs.legs.shape[1]):
            if limbs.legs[foot, k] >= 0:
                total = motion.offset[foot, k]
                for column in range(6):
                    total += work.follow[foot, k, column] * motion.base[column]
                whole[limbs.legs[foot, k]] = total


@compiled
def deliver_forces(
    geometry: ContactGeometry,
    feet: Feet,
    terms: DynamicsTerms,
    nearness: np.ndarray,
    accuracy: Accuracy,
    weight: float,
    start: np.ndarray,
    next_start: np.ndarray,
    i: int,
    work: Work,
    motion: MotionRows,
) -> None:
    """Find the forces on the points that best deliver rows b of M a + h, within their limits.

    They begin at `start` (6,), and write where to begin at the next tick to `next_start`; arms,
    feet and forces of `work` are written. The nearness (6,) turns N and N·m into N whose squares
    are comparable.
    """
    base, to_base = vector(terms.base_position, (i,)), transposed(
        matrix(terms.world_from_base, (i,))
    )  # fmt: skip
    problem, count = work.forces.problem, 0
    for point in range(len(geometry.offset)):
        if not feet.active[i, point]:
            continue
        foot = geometry.foot_of_point[point]
        rotation = matrix(terms.world_from_foot, (i, foot))
        arm = turn(rotation, vector(geometry.offset, (point,)))
        lever = subtract(add(vector(terms.foot_position, (i, foot)), arm), base)
        # Of unit forces along the world's axes: themselves, and lever × force in the base's axes.
        for axis in range(3):
            unit = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
            moment = turn(to_base, cross(lever, unit))
            for k in range(3):
                problem.wrenches[count, axis, k] = nearness[k] * unit[k]
                problem.wrenches[count, axis, 3 + k] = nearness[3 + k] * moment[k]
            problem.limits[count, axis] = feet.limits[i, point, axis]
        store(arm, work.arms, (count,))
        work.feet[count] = foot
        count += 1
    for row in range(6):
        problem.wrench[row] = nearness[row] * (motion.momentum[row] + terms.bias[i, row])
    problem.number[0] = count
    deliver_by_points(work.forces, accuracy, weight, start, next_start)


@compiled
def yield_to_limits(
    mobility: np.ndarray,
    nearness: np.ndarray,
    terms: DynamicsTerms,
    i: int,
    work: Work,
    motion: MotionRows,
) -> None:
    """Change a motion by the least that makes it need just the wrench that the forces deliver."""
    missing = work.forces.point.missing
    if dot(missing, missing) == 0.0:
        return
    linear, angular = 0.0, 0.0
    for axis in range(3):
        linear += mobility[axis] * terms.mass_matrix[i, axis, axis] ** 2 / 3.0
        angular += mobility[3 + axis] * terms.mass_matrix[i, 3 + axis, 3 + axis] ** 2 / 3.0
    least = work.forces.point.gradient
    for row in range(6):
        least[row] = _FAINT * np.sqrt(linear if row < 3 else angular)
        work.share[row] = missing[row] / nearness[row]
        store_six(six(work.reach, (row,)), work.rows, (row,))
        for k in range(len(work.free)):
            work.other_rows[row, k] = work.by_others[row, k]
    serve_body(6, least, work, motion)


@compiled
def joint_torques(
    terms: DynamicsTerms, i: int, work: Work, motion: MotionRows, torque: np.ndarray
) -> None:
    """Write the joint rows of M a + h - J^T f to torque (n,)."""
    for j in range(len(torque)):
        torque[j] = dot(terms.mass_matrix[i, 6 + j], motion.whole) + terms.bias[i, 6 + j]
    for foot in range(terms.foot_jacobian.shape[1]):
        force, moment, bears = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), False
        for point in range(work.forces.problem.number[0]):
            if work.feet[point] == foot:
                pushed = vector(work.forces.point.force, (point,))
                force, bears = add(force, pushed), True
                moment = add(moment, cross(vector(work.arms, (point,)), pushed))
        if bears:
            jacobian = terms.foot_jacobian[i, foot]
            for j in range(len(torque)):
                linear = jacobian[0, 6 + j], jacobian[1, 6 + j], jacobian[2, 6 + j]
                angular = jacobian[3, 6 + j], jacobian[4, 6 + j], jacobian[5, 6 + j]
                torque[j] -= inner(linear, force) + inner(angular, moment)


@compiled
def contact_error(limbs: Limbs, feet: Feet, i: int, work: Work, motion: MotionRows) -> float:
    """Return by how much (m/s^2) the contacts of standing feet would move: |J a + Jdot v|."""
    square = 0.0
    for foot in range(len(limbs.legs)):
        if feet.asked[i, foot] == STANDS:
            # What the ridge leaves: B u + L q - c = -ridge G^-1 (c - L r - B u).
            for row in range(motion.force.shape[1]):
                force = motion.force[foot, row]
                for column in range(6):
                    force -= work.spread[foot, row, column] * motion.base[column]
                square += (work.ridge[foot, row] * force) ** 2
    return np.sqrt(square)


@compiled
def missing_directions(terms: DynamicsTerms, i: int, work: Work) -> float:
    """Return in how many directions of the base the points on the ground cannot push.

    Six where there are none, three on one point, one on points of a line.
    """
    count, longest, widest, far = work.forces.problem.number[0], 0.0, 0.0, (0.0, 0.0, 0.0)
    # The point farthest from the first one, then the one farthest from the line through both.
    for stage in range(2):
        for point in range(count):
            away = subtract(_place(terms, i, work, point), _place(terms, i, work, 0))
            distance = inner(away, away)
            if stage == 0 and distance > longest:
                longest, far = distance, away
            if stage == 1:
                across = cross(far, away)
                widest = max(widest, inner(across, across))
    if count == 0:
        return 6.0
    if longest == 0.0:
        return 3.0
    return 1.0 if widest <= (_LINE * longest) ** 2 else 0.0


@compiled
def _place(terms: DynamicsTerms, i: int, work: Work, point: int) -> Vector:
    """Return the place of a point on the ground, m, world."""
    return add(vector(terms.foot_position, (i, work.feet[point])), vector(work.arms, (point,)))
