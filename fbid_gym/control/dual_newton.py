"""Semismooth Newton method for the six-dimensional dual of the contact force problem.

Solves eps u + G Pi_C(G^T u) = w, see `contact_forces`. The left side is the gradient of a strongly
convex function of u, its generalised Jacobian is a sum over contact points, and the projection Pi_C
onto each point's limits is exact.

Mostly no force is at a limit, and the problem is linear: where points can deliver any w, the
smallest forces that do. Robots need very different numbers of steps, so all here is of one robot.
"""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.dynamics.vectors import (
    NOTHING,
    Vector,
    add,
    add_share,
    scale,
    six,
    store,
    store_six,
    subtract,
    vector,
)
from fbid_gym.dynamics.vectors import dot as inner
from fbid_gym.quantities import Accuracy
from fbid_gym.small_matrices import copy, dot, factor, lift, solve_factored

_SLOPE_REDUCTION = 0.5
_STEPS = (0.004, 0.016, 0.06, 0.125, 0.25, 0.5, 1.0, 2.0, 6.0)
# Few are needed, mostly; with no more than three, one problem in a thousand was never solved.
_LINE_SEARCH_EVALUATIONS = 16
# From the start, then cold by way of stronger regularisations, each easier and close to the next:
# that rarely fails. Zero is the problem's own.
_ROUNDS, _BUDGETS = (0.0, 1e-1, 1e-2, 1e-3, 0.0), (1, 2, 2, 2, 12)
_ROUGH = 1e-2
_FAINT = 1e-9  # regularisation that costs no accuracy but keeps a matrix regular
_DELIVERED = 1e-6  # relative error of the wrench below which it counts as delivered
_TINY = 1e-150  # keeps the direction of a zero tangential force defined


class Problem(NamedTuple):
    """The wrench that the forces of one robot shall deliver, and what they may be."""

    maps: np.ndarray  # (6, 3 P) scaled: G
    wrench: np.ndarray  # (6,) scaled
    limits: np.ndarray  # (P, 3) friction coefficient, least and greatest normal force


class Forces(NamedTuple):
    """The solution; buffers to write to."""

    force: np.ndarray  # (P, 3) N
    missing: np.ndarray  # (6,) scaled wrench of `force` less the desired one; zero if all stick
    dual: np.ndarray  # (6,) the next start


class Points(NamedTuple):
    """The problem, point by point; there may be room for more points than there are."""

    number: np.ndarray  # (1,) int64, P
    wrenches: np.ndarray  # (P, 3, 6): of unit forces of the points, G^T
    wrench: np.ndarray  # (6,)
    limits: np.ndarray  # (P, 3)


class Nearest(NamedTuple):
    """The force within a point's limits that is nearest to another."""

    force: Vector  # N
    slide: float  # N, tangential size s of the other
    cone: float  # N, (z + mu s) / (1 + mu^2)
    ratio: float  # factor on its tangential force


class Point(NamedTuple):
    """A dual point of one robot, and what follows from it; buffers to write to."""

    dual: np.ndarray  # (6,)
    free: np.ndarray  # (P, 3): G^T dual, the forces before projection
    force: np.ndarray  # (P, 3)
    missing: np.ndarray  # (6,): scaled wrench of `force`, less the desired one
    gradient: np.ndarray  # (6,): missing + eps dual, zero at the solution


class NewtonStep(NamedTuple):
    """A Newton step; buffers to write to, so that what is called most makes no arrays."""

    change: np.ndarray  # (6,) of the dual
    jacobian: np.ndarray  # (6, 6)
    way: np.ndarray  # (6,) wrench of a unit force


@compiled
def nearest_force(free: Vector, limits: Vector) -> Nearest:
    """Return the nearest force within a point's limits, exactly.

    In the half-plane of tangential size s and normal force z the limits are a wedge s <= mu z cut
    at two heights. Its nearest point has the normal force clip(max(z, (z + mu s) / (1 + mu^2))),
    whichever part of the boundary it lies on; the tangential force keeps its direction and shrinks
    to mu times the normal force if it is longer.

    Args:
        free: N, tangential, tangential, normal.
        limits: friction coefficient mu, least and greatest normal force.
    """
    x, y, z = free
    friction, lowest, highest = limits
    slide = math.sqrt(x * x + y * y) + _TINY
    cone = (z + friction * slide) / (1.0 + friction * friction)
    normal = min(max(max(z, cone), lowest), highest)
    ratio = min(friction * normal / slide, 1.0)
    return Nearest((ratio * x, ratio * y, normal), slide, cone, ratio)


@compiled
def evaluate(problem: Points, regularisation: float, point: Point) -> float:
    """Update a point from its dual; returns the norm of the gradient."""
    wrenches, missing = problem.wrenches, add_share(NOTHING, -1.0, six(problem.wrench, ()))
    for i in range(problem.number[0]):
        free = _free_force(wrenches, point.dual, i)
        store(free, point.free, (i,))
        nearest = nearest_force(free, vector(problem.limits, (i,)))
        store(nearest.force, point.force, (i,))
        x, y, z = nearest.force
        missing = add_share(missing, x, six(wrenches, (i, 0)))
        missing = add_share(missing, y, six(wrenches, (i, 1)))
        missing = add_share(missing, z, six(wrenches, (i, 2)))
    store_six(missing, point.missing, ())
    _go(point.missing, point.dual, regularisation, point.gradient)
    return np.sqrt(dot(point.gradient, point.gradient))


@compiled
def _free_force(wrenches: np.ndarray, dual: np.ndarray, i: int) -> Vector:
    """G_i^T dual, the force of a point before projection."""
    x, y, z = 0.0, 0.0, 0.0
    for row in range(6):
        x += wrenches[i, 0, row] * dual[row]
        y += wrenches[i, 1, row] * dual[row]
        z += wrenches[i, 2, row] * dual[row]
    return x, y, z


@compiled
def jacobian_at(problem: Points, regularisation: float, point: Point, newton: NewtonStep) -> None:
    """Write the lower half of a generalised Jacobian of the gradient.

    It is the sum G_i D_i G_i^T + eps. A sticking point passes its force on unchanged, but not a
    normal force at its bounds. A sliding point passes it on along the cone's side (mu r + n, r the
    direction of sliding), and across r scaled by the tangential factor. So D_i is a sum of at most
    three dyads, of a size and a direction each.
    """
    jacobian = newton.jacobian
    for row in range(6):
        store_six(NOTHING, jacobian, (row,))
        jacobian[row, row] = regularisation
    for i in range(problem.number[0]):
        free, limits = vector(point.free, (i,)), vector(problem.limits, (i,))
        (friction, lowest, highest), wrenches = limits, problem.wrenches[i]
        nearest = nearest_force(free, limits)
        if nearest.ratio >= 1.0:
            for axis in range(3 if nearest.force[2] == free[2] else 2):
                _add_dyad(1.0, wrenches[axis], jacobian)
        elif nearest.force[2] > 0.0:
            x, y = free[0] / nearest.slide, free[1] / nearest.slide
            first, second = six(wrenches, (0,)), six(wrenches, (1,))
            store_six(add_share(add_share(NOTHING, x, second), -y, first), newton.way, ())
            _add_dyad(nearest.ratio, newton.way, jacobian)
            if lowest <= nearest.cone <= highest:
                along = add_share(six(wrenches, (2,)), friction * x, first)
                store_six(add_share(along, friction * y, second), newton.way, ())
                _add_dyad(1.0 / (1.0 + friction * friction), newton.way, jacobian)


@compiled
def _add_dyad(size: float, way: np.ndarray, jacobian: np.ndarray) -> None:
    """Add size g g^T, g a wrench (6,), to the Jacobian."""
    for row in range(6):
        store_six(add_share(six(jacobian, (row,)), size * way[row], six(way, ())), jacobian, (row,))


@compiled
def _go(start: np.ndarray, change: np.ndarray, step: float, end: np.ndarray) -> None:
    """Write start + step change to `end`."""
    store_six(add_share(six(start, ()), step, six(change, ())), end, ())


@compiled
def _copy(point: Point, to: Point, count: int) -> None:
    for i in range(6):
        to.dual[i], to.missing[i] = point.dual[i], point.missing[i]
        to.gradient[i] = point.gradient[i]
    for i in range(count):
        for axis in range(3):
            to.free[i, axis], to.force[i, axis] = point.free[i, axis], point.force[i, axis]


@compiled
def _slope(
    problem: Points, point: Point, trial: Point, offset: float, growth: float, step: float
) -> float:
    """Slope of the dual function at a share `step` of the way from `point` to `trial`.

    It needs the free forces, which are linear on the way, and no product with the map.
    """
    slope = offset + growth * step
    for i in range(problem.number[0]):
        start = vector(point.free, (i,))
        way = subtract(vector(trial.free, (i,)), start)
        free = add(start, scale(step, way))
        slope += inner(nearest_force(free, vector(problem.limits, (i,))).force, way)
    return slope


@compiled
def _line_search(
    problem: Points, regularisation: float, point: Point, trial: Point, change: np.ndarray
) -> float:
    """Return a better share of a Newton step `change` whose full length, `trial`, is not good.

    The dual function is convex with kinks along the line; its slope brackets the minimum.
    """
    first, last, growth, offset = 0.0, 0.0, 0.0, 0.0
    for row in range(6):
        first += change[row] * point.gradient[row]
        last += change[row] * trial.gradient[row]
        growth += regularisation * change[row] * change[row]
        offset += change[row] * (regularisation * point.dual[row] - problem.wrench[row])
    goal, step = _SLOPE_REDUCTION * abs(first), 1.0
    if not abs(last) > goal:
        return step
    low, low_slope, high, high_slope = 0.0, first, 0.0, first
    for count in range(len(_STEPS) + _LINE_SEARCH_EVALUATIONS):
        # A coarse grid brackets the minimum, and regula falsi (Illinois) refines it.
        brackets = not high_slope < 0.0 or count >= len(_STEPS)
        if not brackets:
            step = _STEPS[count]
        else:
            rise = high_slope - low_slope
            step = min(low - (high - low) * low_slope / rise, high) if rise > 0.0 else high
        slope = _slope(problem, point, trial, offset, growth, step)
        if brackets and not abs(slope) > goal:
            break
        if not brackets:
            low, low_slope, high, high_slope = high, high_slope, step, slope
        elif slope < 0.0:
            low, low_slope, high_slope = step, slope, 0.5 * high_slope
        else:
            high, high_slope, low_slope = step, slope, 0.5 * low_slope
    return step


@compiled
def _newton(
    problem: Points,
    regularisation: float,
    tolerance: float,
    budget: int,
    point: Point,
    trial: Point,
    newton: NewtonStep,
) -> tuple[float, int]:
    """Improve a point until solved or `budget` steps are spent; returns its error, and the steps.

    `trial` and `newton` are buffers. What is called here is compiled once for each call in the
    text, so there is one of each.
    """
    change, jacobian, taken, shortened, least = newton.change, newton.jacobian, 0, False, np.inf
    copy(point.dual, trial.dual)
    while True:
        error = evaluate(problem, regularisation, trial)
        if taken > 0 and error > tolerance and not shortened:
            step = _line_search(problem, regularisation, point, trial, change)
            if step != 1.0:
                _go(point.dual, change, step, trial.dual)
                shortened = True
                continue
        if taken > 0 and not error < np.inf:
            return least, taken
        _copy(trial, point, problem.number[0])
        if not error > tolerance or taken == budget:
            return error, taken
        least, shortened, taken = error, False, taken + 1
        jacobian_at(problem, regularisation, point, newton)
        store_six(add_share(NOTHING, -1.0, six(point.gradient, ())), change, ())
        lift(jacobian, regularisation)
        factor(jacobian)
        solve_factored(jacobian, change)
        _go(point.dual, change, 1.0, trial.dual)


class Room(NamedTuple):
    """A problem, its solution and buffers, made once: what is called most makes no arrays."""

    problem: Points
    point: Point  # its force, missing and dual are those of the solution
    trial: Point
    newton: NewtonStep


@compiled
def room_for(points: int) -> Room:
    """Return room for a problem of no more than so many points."""
    return Room(
        Points(np.zeros(1, np.int64), np.empty((points, 3, 6)), np.empty(6), np.empty((points, 3))),
        _room_for_point(points),
        _room_for_point(points),
        NewtonStep(np.empty(6), np.empty((6, 6)), np.empty(6)),
    )


@compiled
def _room_for_point(points: int) -> Point:
    six_each, three_each = np.empty((3, 6)), np.empty((2, points, 3))
    return Point(six_each[0], three_each[0], three_each[1], six_each[1], six_each[2])


@compiled
def _are_inside(problem: Points, dual: np.ndarray, force: np.ndarray) -> bool:
    """Write the forces G^T dual (P, 3) up to the first that is not within its limits."""
    for i in range(problem.number[0]):
        x, y, normal = _free_force(problem.wrenches, dual, i)
        store((x, y, normal), force, (i,))
        friction, lowest, highest = vector(problem.limits, (i,))
        if not (lowest <= normal <= highest and x * x + y * y <= (friction * normal) ** 2):
            return False
    return True


@compiled
def _stick(problem: Points, ridge: float, point: Point, gram: np.ndarray) -> bool:
    """Write dual, force and missing wrench of a point if no force is at a limit; whether none is.

    The regularisation is `ridge`; `gram` (6, 6) is a buffer.
    """
    wrenches, dual = problem.wrenches, point.dual
    for row in range(6):
        sums = NOTHING
        for i in range(problem.number[0]):
            for axis in range(3):
                sums = add_share(sums, wrenches[i, axis, row], six(wrenches, (i, axis)))
        store_six(sums, gram, (row,))
        gram[row, row] += ridge
    factor(gram)
    copy(problem.wrench, dual)
    solve_factored(gram, dual)
    if not _are_inside(problem, dual, point.force):
        return False
    store_six(add_share(NOTHING, -ridge, six(dual, ())), point.missing, ())
    return True


@compiled
def deliver(
    problem: Problem, accuracy: Accuracy, weight: float, start: np.ndarray, found: Forces
) -> int:
    """Solve the problem of one robot, see `deliver_by_points`; writes to `found`."""
    count = len(problem.limits)
    room = room_for(count)
    points, point = room.problem, room.point
    points.number[0] = count
    copy(problem.wrench, points.wrench)
    for i in range(count):
        copy(problem.limits[i], points.limits[i])
        for axis in range(3):
            for row in range(6):
                points.wrenches[i, axis, row] = problem.maps[row, 3 * i + axis]
    taken = deliver_by_points(room, accuracy, weight, start, found.dual)
    copy(point.missing, found.missing)
    for i in range(count):
        copy(point.force[i], found.force[i])
    return taken


@compiled
def deliver_by_points(
    room: Room, accuracy: Accuracy, weight: float, start: np.ndarray, next_start: np.ndarray
) -> int:
    """Solve the problem of one robot.

    Forces of which none is at a limit are tried first, or last where one of more than two was at a
    limit at `start`. In between is Newton's method, see `_in_rounds`. What that leaves unsolved
    gets the better of its last forces and those at `start`.

    Args:
        room: with the problem; its point is written.
        accuracy: of the solution.
        weight: N, of the robot, to which the tolerance is relative.
        start: (6,) dual point to begin with.
        next_start: (6,) where to begin next; written.

    Returns:
        The Newton steps taken.
    """
    problem, point, trial, newton = room.problem, room.point, room.trial, room.newton
    eps, tolerance = accuracy.regularisation, accuracy.tolerance * weight
    # A wrench has six numbers, and two points can deliver five of them.
    spans = problem.number[0] > 2
    error, taken, free = 0.0, 0, not spans or _are_inside(problem, start, trial.force)
    copy(start, point.dual)
    while True:
        if free and _stick(problem, _FAINT if spans else eps, trial, newton.jacobian):
            wrench, missing = problem.wrench, trial.missing
            if not spans or dot(missing, missing) <= _DELIVERED**2 * dot(wrench, wrench):
                for row in range(6):
                    missing[row] *= 0.0 if spans else 1.0
                _copy(trial, point, problem.number[0])
                break
        error, steps = _in_rounds(room, accuracy, tolerance)
        taken += steps
        if free or error > tolerance or not _are_inside(problem, point.dual, trial.force):
            break
        free = True
    copy(point.dual, next_start)
    if error > tolerance:
        copy(start, trial.dual)
        evaluate(problem, eps, trial)
        if dot(trial.missing, trial.missing) < dot(point.missing, point.missing):
            _copy(trial, point, problem.number[0])
    return taken


@compiled
def _in_rounds(room: Room, accuracy: Accuracy, tolerance: float) -> tuple[float, int]:
    """Improve `room.point` by Newton's method; returns its error, and the steps taken.

    After `max_iterations` steps comes a cold start by way of stronger regularisations, in three
    rounds of at most twice as many steps and a last one of twelve times as many.
    """
    problem, eps = room.problem, accuracy.regularisation
    rough = max(tolerance, _ROUGH * np.sqrt(dot(problem.wrench, problem.wrench)))
    error, taken = np.inf, 0
    for k in range(len(_ROUNDS)):
        own = _ROUNDS[k] == 0.0
        if k == 1:
            store_six(NOTHING, room.point.dual, ())
        if not own and _ROUNDS[k] <= eps:
            continue
        stage, goal = (eps, tolerance) if own else (_ROUNDS[k], rough)
        budget = _BUDGETS[k] * accuracy.max_iterations
        error, steps = _newton(problem, stage, goal, budget, room.point, room.trial, room.newton)
        taken += steps
        if own and not error > tolerance:
            break
    return error, taken
