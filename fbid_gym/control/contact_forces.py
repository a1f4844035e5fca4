"""Contact forces that friction and unilaterality allow: a batched cone-constrained least squares.

The forces f_i of the contact points shall deliver a base wrench w as well as they can:

    minimise 1/2 (G f - w)^T S (G f - w) + eps/2 |f|^2   subject to   f_i in C_i,
    C_i = {|tangential force| <= mu * normal force, lowest <= normal force <= highest}.

Mostly the smallest forces that deliver w lie within the limits. They are tried first, and taken as
they are. Otherwise there are many forces, but only six numbers in w: with y = S (w - G f), the
optimal forces are the projection f = Pi_C(G^T y / eps), which acts on each point alone, and what
remains is one equation in six unknowns, S^-1 y + G Pi_C(G^T y / eps) = w. Its left side is the
gradient of a strongly convex function and piecewise smooth, so a semismooth Newton method with a
line search solves it in about as many 6x6 solves as points change between sticking, sliding and
lifting. Every iterate is feasible, because it is a projection. A prototype's
first-order method (ADMM) took about 25 iterations.

How exact that is: with the default tolerance the wrench is that of the optimum to 1e-4 of the
weight (at most 8e-5 in thousands of trials, cold and infeasible ones among them). The default eps
moves the optimum itself by up to 1e-3 of the weight while points slide or lift, typically by 1e-4,
and not at all while they stick.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.control.arrays import (
    Array,
    as_flags,
    as_numpy,
    check_shape,
    from_numpy,
)
from fbid_gym.control.dual_newton import deliver
from fbid_gym.errors import InvalidValueError, ShapeError

REGULARISATION = 1e-4
TOLERANCE = 1e-4
MAX_ITERATIONS = 8
_LARGEST = float(np.finfo(np.float64).max)


@dataclass(frozen=True, eq=False)
class ContactLimits:
    """What a contact point can transmit. Each entry is a number or broadcasts to (N, P).

    Attributes:
        friction: friction coefficient mu: |tangential force| <= mu * normal force.
        min_normal_force: N, least normal force of a point in contact.
        max_normal_force: N, greatest normal force; infinity for none.

    Raises:
        InvalidValueError: an entry is negative or NaN, friction or the minimum is infinite, or the
            minimum exceeds the maximum.
    """

    friction: Array = 0.7
    min_normal_force: Array = 0.0
    max_normal_force: Array = np.inf

    def __post_init__(self) -> None:
        """Convert to arrays and validate."""
        for name in ("friction", "min_normal_force", "max_normal_force"):
            given, largest = getattr(self, name), np.inf if name == "max_normal_force" else _LARGEST
            try:
                value = np.asarray(given, dtype=np.float64)
                valid = bool(np.all((value >= 0.0) & (value <= largest)))
            except (TypeError, ValueError):
                valid = False
            if not valid:
                finite = "" if largest == np.inf else "finite "
                raise InvalidValueError(name, given, f"{finite}numbers of at least 0")
            object.__setattr__(self, name, value)
        try:
            ordered = bool(np.all(self.min_normal_force <= self.max_normal_force))
        except ValueError:
            ordered = False
        if not ordered:
            expected = f"at most max_normal_force, {self.max_normal_force}"
            raise InvalidValueError("min_normal_force", self.min_normal_force, expected)


class ContactForces(NamedTuple):
    """Feasible contact forces and how well they deliver the wrench.

    Attributes:
        force: (N, P, 3) N, two tangential components, then the normal one.
        wrench: (N, 6) what they deliver, G f: force in N, moment in N m.
        residual: (N,) weighted distance of the wrench from the desired one, per weight; zero where
            all points stick.
        iterations: (N,) Newton steps taken, integers.
        dual: (N, 6) warm start for the next call with the same scales; zero is a cold start.
    """

    force: Array
    wrench: Array
    residual: Array
    iterations: Array
    dual: Array


def limited_contact_forces(
    wrench_map: Array,
    wrench: Array,
    limits: ContactLimits,
    *,
    weight: float | Array,
    length: float = 1.0,
    wrench_cost: tuple[float, ...] | None = None,
    active: Array | None = None,
    warm_start: Array | None = None,
    regularisation: float = REGULARISATION,
    tolerance: float = TOLERANCE,
    max_iterations: int = MAX_ITERATIONS,
) -> ContactForces:
    """Contact forces within friction and normal force limits that best deliver a wrench.

    The wrench error is measured per weight for forces and per weight * length for moments, squared
    and weighted by `wrench_cost`. `regularisation` prefers small forces among those that deliver
    about the same wrench.

    Torch tensors are computed on the host, in double precision, and come back as what they were.

    Args:
        wrench_map: (N, 6, 3 P), the G of stacked point forces: rows force, then moment.
        wrench: (N, 6) desired, N and N m.
        limits: friction and normal force limits.
        weight: N, of the robot; a number or (N,). Scales the tolerance and the residual only.
        length: m, a lever arm that makes moments comparable to forces.
        wrench_cost: six positive weights of the squared errors. Default: ones.
        active: (N, P) bool, points in contact; the others get zero force. Default: all.
        warm_start: (N, 6) `dual` of an earlier result. Default: zeros.
        regularisation: eps, dimensionless.
        tolerance: stop when the optimality condition holds to this share of the weight.
        max_iterations: Newton steps before a robot is solved anew, cold and by way of stronger
            regularisations, in four rounds of at most twice as many steps. Forces are feasible, and
            no worse than those of the warm start, even if that should not suffice.

    Returns:
        ContactForces; finite, and within the limits, for every finite input.

    Raises:
        ShapeError: an array does not fit.
        InvalidValueError: `length` or `wrench_cost` is not positive and finite.
    """
    shape = tuple(wrench_map.shape)
    if len(shape) != 3 or shape[1] != 6 or shape[2] % 3:
        raise ShapeError("wrench_map", shape, "(N, 6, 3 P)")
    count, points = shape[0], shape[2] // 3
    check_shape("wrench", wrench, (count, 6), "(N, 6)")
    check_contact_options(limits, active, warm_start, count, points)
    start = np.zeros((count, 6)) if warm_start is None else as_numpy(warm_start)
    scale = wrench_scale(length, wrench_cost)
    weights = np.broadcast_to(weight if np.isscalar(weight) else as_numpy(weight), (count,))
    desired = as_numpy(wrench)
    force, missing = np.empty((count, points, 3)), np.empty((count, 6))
    dual, iterations = np.empty((count, 6)), np.empty(count, np.int64)
    _deliver_all(
        as_numpy(wrench_map) * scale[:, None],
        desired * scale,
        tolerance * weights,
        start,
        limit_rows(limits, points),
        all_active(points) if active is None else as_flags(active),
        regularisation,
        max_iterations,
        force,
        missing,
        dual,
        iterations,
    )
    delivered, residual = desired + missing / scale, np.sqrt(np.vecdot(missing, missing)) / weights
    found = force, delivered, residual, iterations, dual
    return ContactForces(*(from_numpy(x, like=wrench) for x in found))


@lru_cache(maxsize=256)
def wrench_scale(length: float, wrench_cost: tuple[float, ...] | None) -> np.ndarray:
    """(6,) factors that turn N and N m into N whose squares are comparable."""
    cost = (1.0,) * 6 if wrench_cost is None else tuple(wrench_cost)
    for name, value, size in (("length", (length,), 1), ("wrench_cost", cost, 6)):
        if len(value) != size or not all(0.0 < x < np.inf for x in value):
            raise InvalidValueError(name, value, f"{size} positive, finite numbers")
    arms = np.array([1.0, 1.0, 1.0, length, length, length])
    return np.sqrt(cost) / arms


def check_contact_options(
    limits: ContactLimits, active: Array | None, warm_start: Array | None, count: int, points: int
) -> None:
    """Raise ShapeError unless limits, mask and warm start fit (N, P)."""
    _check_limits(limits, count, points)
    if active is not None:
        check_shape("active", active, (count, points), "(N, P)")
    if warm_start is not None:
        check_shape("warm_start", warm_start, (count, 6), "(N, 6)")


@lru_cache(maxsize=256)
def _check_limits(limits: ContactLimits, count: int, points: int) -> None:
    for name in ("friction", "min_normal_force", "max_normal_force"):
        shape = getattr(limits, name).shape
        if shape not in ((), (1,), (points,), (1, points), (count, 1), (count, points)):
            raise ShapeError(name, shape, f"a number, (P,) or (N, P) = {(count, points)}")


@lru_cache(maxsize=256)
def limit_rows(limits: ContactLimits, points: int) -> np.ndarray:
    """(N, P, 3), or (1, P, 3) for all robots: friction, lowest and highest normal force."""
    numbers = (limits.friction, limits.min_normal_force, limits.max_normal_force)
    rows = np.stack(np.broadcast_arrays(*numbers, np.empty((1, points)))[:3], axis=-1)
    return np.ascontiguousarray(rows)


@lru_cache(maxsize=32)
def all_active(points: int) -> np.ndarray:
    """(1, P): all points of all robots are in contact."""
    return np.ones((1, points), bool)


@kernel
def _deliver_all(
    maps: np.ndarray,
    wrench: np.ndarray,
    tolerance: np.ndarray,
    start: np.ndarray,
    limits: np.ndarray,
    active: np.ndarray,
    regularisation: float,
    budget: int,
    force: np.ndarray,
    missing: np.ndarray,
    dual: np.ndarray,
    iterations: np.ndarray,
) -> None:
    """`deliver` for every robot; the last four are to write to."""
    values = np.empty((force.shape[1], 3))
    for i in range(len(force)):
        limits_in_contact(limits, active, i, values)
        iterations[i] = deliver(
            maps[i],
            wrench[i],
            values,
            tolerance[i],
            regularisation,
            budget,
            start[i],
            force[i],
            missing[i],
            dual[i],
        )


@compiled
def limits_in_contact(
    limits: np.ndarray, active: np.ndarray, robot: int, values: np.ndarray
) -> None:
    """Write the limits of a robot's points, zero where they are not in contact, to `values` (P, 3).

    Args:
        limits: (N or 1, P, 3) of `limit_rows`.
        active: (N or 1, P) bool.
        robot: which of them.
        values: (P, 3).
    """
    row, present = limits[min(robot, len(limits) - 1)], active[min(robot, len(active) - 1)]
    for i in range(len(values)):
        for axis in range(3):
            values[i, axis] = row[i, axis] if present[i] else 0.0
