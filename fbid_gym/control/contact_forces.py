"""Contact forces that friction and unilaterality allow: a batched cone-constrained least squares.

The forces f_i of the contact points shall deliver a base wrench w as well as they can:

    minimise 1/2 (G f - w)^T S (G f - w) + eps/2 |f|^2   subject to   f_i in C_i,
    C_i = {|tangential force| <= mu * normal force, lowest <= normal force <= highest}.

Many forces, but only six numbers in w. With y = S (w - G f), the optimal forces are the projection
f = Pi_C(G^T y / eps), which acts on each point alone, and what remains is one equation in six
unknowns, S^-1 y + G Pi_C(G^T y / eps) = w. Its left side is the gradient of a strongly convex
function and piecewise smooth, so a semismooth Newton method with a line search solves it in as many
6x6 solves as points change between sticking, sliding and lifting. That is one in steady stance,
where a first-order method (ADMM) needs tens of iterations each about as expensive, and every
iterate is feasible because it is a projection.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fbid_gym.control.arrays import Array, check_shape, constant, identity, matvec, namespace
from fbid_gym.errors import InvalidValueError, ShapeError

REGULARISATION = 5e-5
TOLERANCE = 1e-5
MAX_ITERATIONS = 12
_LINE_SEARCH_EVALUATIONS = 6
_TINY = 1e-300


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
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if not np.all(value >= 0.0):
                raise InvalidValueError(name, getattr(self, name), "numbers of at least 0")
            if name != "max_normal_force" and not np.all(np.isfinite(value)):
                raise InvalidValueError(name, getattr(self, name), "finite numbers of at least 0")
            object.__setattr__(self, name, value)
        if not np.all(self.min_normal_force <= self.max_normal_force):
            raise InvalidValueError(
                "min_normal_force",
                self.min_normal_force,
                f"at most max_normal_force = {self.max_normal_force}",
            )


class ContactForces(NamedTuple):
    """Feasible contact forces and how well they deliver the wrench.

    Attributes:
        force: (N, P, 3) N, two tangential components, then the normal one.
        wrench: (N, 6) what they deliver, G f: force in N, moment in N m.
        residual: (N,) weighted distance of the wrench from the desired one, per weight.
        iterations: (N,) Newton steps taken, integers.
        dual: (N, 6) state that warm-starts the next call with the same scales. Zero is a cold start.
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
    and weighted by `wrench_cost`. `regularisation` chooses among the forces that deliver the same
    wrench the smallest, at the price of a small wrench error even where w is feasible.

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
        max_iterations: Newton steps at most. A robot that needs more gets feasible, improvable forces.

    Returns:
        ContactForces; finite, and within the limits, for every finite input.

    Raises:
        ShapeError: an array does not fit.
    """
    shape = tuple(wrench_map.shape)
    if len(shape) != 3 or shape[1] != 6 or shape[2] % 3:
        raise ShapeError("wrench_map", shape, "(N, 6, 3 P)")
    count, points = shape[0], shape[2] // 3
    check_shape("wrench", wrench, (count, 6), "(N, 6)")
    check_contact_options(limits, active, warm_start, count, points)
    xp = namespace(wrench_map)
    scale = wrench_scale(length, wrench_cost, wrench_map)
    weight = xp.asarray(weight, dtype=wrench.dtype, device=wrench.device)
    solution = solve_contact_forces(
        wrench_map * scale[:, None],
        wrench * scale,
        limits,
        weight=weight,
        active=active,
        warm_start=warm_start,
        regularisation=regularisation,
        tolerance=tolerance,
        max_iterations=max_iterations,
    )
    return solution._replace(wrench=solution.wrench / scale)


def wrench_scale(length: float, wrench_cost: tuple[float, ...] | None, like: Array) -> Array:
    """(6,) factors that turn N and N m into N whose squares are comparable."""
    cost = (1.0,) * 6 if wrench_cost is None else tuple(wrench_cost)
    arms = (1.0, 1.0, 1.0, length, length, length)
    return constant(tuple(c**0.5 / arm for c, arm in zip(cost, arms, strict=True)), like)


def check_contact_options(
    limits: ContactLimits, active: Array | None, warm_start: Array | None, count: int, points: int
) -> None:
    """Raise ShapeError unless limits, mask and warm start fit (N, P)."""
    for name in ("friction", "min_normal_force", "max_normal_force"):
        shape = getattr(limits, name).shape
        if shape not in ((), (1,), (points,), (1, points), (count, 1), (count, points)):
            raise ShapeError(name, shape, f"a number, (P,) or (N, P) = {(count, points)}")
    if active is not None:
        check_shape("active", active, (count, points), "(N, P)")
    if warm_start is not None:
        check_shape("warm_start", warm_start, (count, 6), "(N, 6)")


class _Problem(NamedTuple):
    """The scaled problem: eps u + G Pi_C(G^T u) = w, u in N."""

    wrench_map: Array  # (N, 6, 3 P)
    wrench: Array  # (N, 6)
    friction: Array  # broadcasts to (N, P), as the next three
    share: Array  # 1 / (1 + mu^2)
    lowest: Array
    highest: Array
    tolerance: Array  # (N,) or (), N^2: of the squared error
    regularisation: float

    def rows(self, index: Array) -> "_Problem":
        """The problem of some robots."""
        arrays = (
            x[index] if x.ndim and x.shape[0] > 1 and (x.ndim > 1 or i == 6) else x
            for i, x in enumerate(self[:-1])
        )
        return _Problem(*arrays, self.regularisation)


class _Point(NamedTuple):
    """A dual point, the forces it stands for, and the optimality condition there."""

    dual: Array  # (N, 6)
    free: Array  # (N, P, 3): forces before projection
    slide: Array  # (N, P): tangential size of `free`
    cone: Array  # (N, P): normal force where the cone's side is nearest
    ratio: Array  # (N, P): factor on the tangential force, 1 if sticking
    force: Array  # (N, P, 3)
    delivered: Array  # (N, 6): scaled wrench of `force`
    gradient: Array  # (N, 6)
    error: Array  # (N,): squared norm of `gradient`

    def rows(self, index: Array) -> "_Point":
        """The points of some robots."""
        return _Point(*(x[index] for x in self))


def project(
    free: Array, friction: Array, lowest: Array, highest: Array, share: Array
) -> tuple[Array, Array, Array, Array]:
    """Nearest forces within the limits, exactly.

    In the half-plane of tangential size s and normal force z the limits are a wedge s <= mu z cut
    at two heights. Its nearest point has the normal force clip(max(z, (z + mu s) / (1 + mu^2))),
    whichever part of the boundary it lies on; the tangential force keeps its direction and shrinks
    to mu times the normal force if it is longer.

    Args:
        free: (N, P, 3) N, tangential, tangential, normal.
        friction: mu; this and the following broadcast to (N, P).
        lowest: N, least normal force.
        highest: N, greatest normal force.
        share: 1 / (1 + mu^2).

    Returns:
        Force (N, P, 3), then (N, P) each: s, (z + mu s) / (1 + mu^2), and the tangential factor.
    """
    xp = namespace(free)
    x, y, z = free[..., 0], free[..., 1], free[..., 2]
    slide = xp.sqrt(x * x + y * y + _TINY)
    cone = (z + friction * slide) * share
    normal = xp.minimum(xp.maximum(xp.maximum(z, cone), lowest), highest)
    ratio = xp.minimum(friction * normal / slide, constant(1.0, free))
    force = xp.concat([free[..., :2] * ratio[..., None], normal[..., None]], axis=-1)
    return force, slide, cone, ratio


def _evaluate(problem: _Problem, dual: Array) -> _Point:
    xp = namespace(dual)
    count, _, columns = problem.wrench_map.shape
    free = xp.reshape(dual[:, None, :] @ problem.wrench_map, (count, columns // 3, 3))
    force, slide, cone, ratio = project(
        free, problem.friction, problem.lowest, problem.highest, problem.share
    )
    delivered = matvec(problem.wrench_map, xp.reshape(force, (count, columns)))
    gradient = problem.regularisation * dual + delivered - problem.wrench
    error = xp.vecdot(gradient, gradient)
    return _Point(dual, free, slide, cone, ratio, force, delivered, gradient, error)


def _hessian(problem: _Problem, point: _Point) -> Array:
    """A generalised Jacobian of the gradient, (N, 6, 6).

    A sticking point passes its force on unchanged, a clipped normal force not at all. A sliding
    point passes it on along the cone's side (mu r + n, r the direction of sliding), and across r
    scaled by `ratio`.
    """
    xp = namespace(point.dual)
    maps = problem.wrench_map
    count, _, columns = maps.shape
    normal = point.free[..., 2]
    sticks = point.ratio >= 1.0
    between = (normal >= problem.lowest) & (normal <= problem.highest)
    passes = xp.astype(sticks & between, maps.dtype)
    factors = xp.reshape(xp.stack([point.ratio, point.ratio, passes], axis=-1), (count, 1, columns))
    hessian = (maps * factors) @ maps.mT + identity(6, maps, problem.regularisation)
    if xp.all(sticks):
        return hessian
    # Beyond that, only for sliding points: the side of the cone, less the radial part counted above.
    sliding = xp.astype(~sticks, maps.dtype)
    on_side = (point.cone >= problem.lowest) & (point.cone <= problem.highest)
    along = sliding * xp.astype(on_side, maps.dtype) * problem.share
    across = -sliding * point.ratio
    direction = point.free[..., :2] / point.slide[..., None]
    split = xp.reshape(maps, (count, 6, columns // 3, 3))
    radial = split[..., 0] * direction[:, None, :, 0] + split[..., 1] * direction[:, None, :, 1]
    side = radial * _column(problem.friction) + split[..., 2]
    left = xp.concat([side * along[:, None, :], radial * across[:, None, :]], axis=-1)
    right = xp.concat([side, radial], axis=-1)
    return hessian + left @ right.mT


def _column(limit: Array) -> Array:
    """A limit that broadcasts to (N, P), made to broadcast to (N, 6, P)."""
    return limit[:, None, :] if limit.ndim == 2 else limit


def _line_search(problem: _Problem, point: _Point, trial: _Point, change: Array) -> Array:
    """Step lengths near the minimum along a Newton step whose full length is not good enough.

    The dual function is convex with kinks along the line; its slope brackets the minimum. Each
    evaluation projects forces but needs no matrix product.
    """
    xp = namespace(change)
    count, _, columns = problem.wrench_map.shape
    step_free = trial.free - point.free
    flat = xp.reshape(step_free, (count, columns))
    constant_slope = problem.regularisation * xp.vecdot(change, point.dual) - xp.vecdot(
        change, problem.wrench
    )
    growth = problem.regularisation * xp.vecdot(change, change)
    first = xp.vecdot(change, point.gradient)
    step = xp.ones_like(first)
    slope = xp.vecdot(change, trial.gradient)
    low, low_slope = xp.zeros_like(first), first
    high, high_slope = xp.full_like(first, xp.inf), xp.ones_like(first)
    for _ in range(_LINE_SEARCH_EVALUATIONS):
        settled = xp.abs(slope) <= 0.5 * xp.abs(first)
        if xp.all(settled):
            break
        short = slope < 0.0
        low, low_slope = xp.where(short, step, low), xp.where(short, slope, low_slope)
        high, high_slope = xp.where(short, high, step), xp.where(short, high_slope, slope)
        bounded = xp.isfinite(high)
        width = xp.where(bounded, high, low) - low
        share = -low_slope / xp.where(bounded, high_slope - low_slope, xp.ones_like(slope))
        inner = low + width * xp.clip(share, 0.1, 0.9)
        step = xp.where(settled, step, xp.where(bounded, inner, 3.0 * step))
        force = project(
            point.free + step[:, None, None] * step_free,
            problem.friction,
            problem.lowest,
            problem.highest,
            problem.share,
        )[0]
        slope = (
            constant_slope + step * growth + xp.vecdot(flat, xp.reshape(force, (count, columns)))
        )
    return step


def _improve(problem: _Problem, point: _Point) -> _Point:
    """One Newton step, shortened or lengthened where the full step is poor."""
    xp = namespace(point.dual)
    hessian = _hessian(problem, point)
    change = -xp.linalg.solve(hessian, point.gradient[..., None])[..., 0]
    trial = _evaluate(problem, point.dual + change)
    unsolved = trial.error > problem.tolerance
    if not xp.any(unsolved):
        return trial
    slope = xp.vecdot(change, trial.gradient)
    poor = unsolved & (xp.abs(slope) > 0.5 * xp.abs(xp.vecdot(change, point.gradient)))
    if not xp.any(poor):
        return trial
    step = xp.where(poor, _line_search(problem, point, trial, change), constant(1.0, change))
    return _evaluate(problem, point.dual + step[:, None] * change)


def _newton(problem: _Problem, point: _Point, budget: int) -> tuple[_Point, Array]:
    """Improve the points until each is solved or `budget` steps are spent.

    Robots that are solved leave the batch: the others' extra steps neither change nor delay them.
    """
    xp = namespace(point.dual)
    taken = 0
    while taken < budget:
        unsolved = point.error > problem.tolerance
        if not xp.any(unsolved):
            break
        if not xp.all(unsolved):
            rows = xp.nonzero(unsolved)[0]
            rest, more = _newton(problem.rows(rows), point.rows(rows), budget - taken)
            iterations = xp.full(unsolved.shape, taken, dtype=xp.int64, device=point.dual.device)
            iterations[rows] += more
            for whole, part in zip(point, rest, strict=True):
                whole[rows] = part
            return point, iterations
        point = _improve(problem, point)
        taken += 1
    shape = point.error.shape
    return point, xp.full(shape, taken, dtype=xp.int64, device=point.dual.device)


def solve_contact_forces(
    wrench_map: Array,
    wrench: Array,
    limits: ContactLimits,
    *,
    weight: Array,
    active: Array | None = None,
    warm_start: Array | None = None,
    regularisation: float = REGULARISATION,
    tolerance: float = TOLERANCE,
    max_iterations: int = MAX_ITERATIONS,
) -> ContactForces:
    """`limited_contact_forces` on a wrench and map already scaled, without checks.

    Args:
        wrench_map: (N, 6, 3 P) times `wrench_scale`.
        wrench: (N, 6) times `wrench_scale`.
        limits: as there, like all that follow.
        weight: (N,) or () array.
        active: (N, P) bool.
        warm_start: (N, 6).
        regularisation: eps.
        tolerance: share of the weight.
        max_iterations: Newton steps at most.

    Returns:
        ContactForces, its wrench scaled.
    """
    xp = namespace(wrench_map)
    kind = {"dtype": wrench_map.dtype, "device": wrench_map.device}
    friction = xp.asarray(limits.friction, **kind)
    lowest = xp.asarray(limits.min_normal_force, **kind)
    highest = xp.asarray(limits.max_normal_force, **kind)
    if active is not None:
        zero = constant(0.0, wrench)
        lowest, highest = xp.where(active, lowest, zero), xp.where(active, highest, zero)
    problem = _Problem(
        wrench_map,
        wrench,
        friction,
        1.0 / (1.0 + friction * friction),
        lowest,
        highest,
        (tolerance * weight) ** 2,
        regularisation,
    )
    dual = xp.zeros_like(wrench) if warm_start is None else xp.asarray(warm_start, copy=True)
    point, iterations = _newton(problem, _evaluate(problem, dual), max_iterations)
    missing = point.delivered - wrench
    residual = xp.sqrt(xp.vecdot(missing, missing)) / weight
    return ContactForces(point.force, point.delivered, residual, iterations, point.dual)
