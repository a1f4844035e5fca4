"""Semismooth Newton method for the six-dimensional dual of the contact force problem.

Solves eps u + G Pi_C(G^T u) = w for N robots, see `contact_forces`. The left side is the gradient
of a strongly convex function of u, its generalised Jacobian is a sum over contact points, and the
projection Pi_C onto each point's limits is exact.
"""

from typing import NamedTuple

from fbid_gym.control.arrays import Array, constant, identity, namespace

_SLOPE_REDUCTION = 0.5
_STEPS = (0.0, 0.004, 0.016, 0.06, 0.125, 0.25, 0.5, 1.0, 2.0, 6.0)
_LINE_SEARCH_EVALUATIONS = 3
_FAINT = 1e-9  # regularisation that costs no accuracy but keeps a matrix regular
_TINY = 1e-150  # keeps the direction of a zero tangential force defined


class DualProblem(NamedTuple):
    """The scaled problem: eps u + G Pi_C(G^T u) = w, u in N."""

    wrench_map: Array  # (N, 6, 3 P)
    wrench: Array  # (N, 6)
    friction: Array  # (N, P), (P,) or (), as the next three
    share: Array  # 1 / (1 + mu^2)
    lowest: Array
    highest: Array
    tolerance: Array  # (N,) or (), N^2: of the squared error
    regularisation: float

    def rows(self, rows: Array) -> "DualProblem":
        """The problem of some robots."""

        def pick(limit: Array) -> Array:
            return limit[rows] if limit.ndim == 2 and limit.shape[0] > 1 else limit

        return DualProblem(
            self.wrench_map[rows],
            self.wrench[rows],
            pick(self.friction),
            pick(self.share),
            pick(self.lowest),
            pick(self.highest),
            self.tolerance[rows] if self.tolerance.ndim else self.tolerance,
            self.regularisation,
        )


class DualPoint(NamedTuple):
    """A dual point, the forces it stands for, and the optimality condition there."""

    dual: Array  # (N, 6)
    free: Array  # (N, P, 3): forces before projection
    slide: Array  # (N, P): tangential size of `free`
    cone: Array  # (N, P): normal force where the cone's side is nearest
    ratio: Array  # (N, P): factor on the tangential force, 1 if sticking
    force: Array  # (N, P, 3)
    missing: Array  # (N, 6): scaled wrench of `force`, less the desired one
    gradient: Array  # (N, 6)
    error: Array  # (N,): squared norm of `gradient`

    def rows(self, rows: Array) -> "DualPoint":
        """The points of some robots."""
        return DualPoint(*(x[rows] for x in self))


def project(
    free: Array, friction: Array, share: Array, lowest: Array, highest: Array
) -> tuple[Array, Array, Array, Array]:
    """Nearest forces within the limits, exactly.

    In the half-plane of tangential size s and normal force z the limits are a wedge s <= mu z cut
    at two heights. Its nearest point has the normal force clip(max(z, (z + mu s) / (1 + mu^2))),
    whichever part of the boundary it lies on; the tangential force keeps its direction and shrinks
    to mu times the normal force if it is longer.

    Args:
        free: (N, P, 3) N, tangential, tangential, normal.
        friction: mu; this and the following broadcast to (N, P).
        share: 1 / (1 + mu^2).
        lowest: N, least normal force.
        highest: N, greatest normal force.

    Returns:
        Force (N, P, 3), then (N, P) each: s, (z + mu s) / (1 + mu^2), and the tangential factor.
    """
    xp = namespace(free)
    normal = free[..., 2]
    slide = xp.hypot(free[..., 0], free[..., 1]) + _TINY
    cone = (normal + friction * slide) * share
    normal = xp.minimum(xp.maximum(xp.maximum(normal, cone), lowest), highest)
    ratio = xp.minimum(friction * normal / slide, constant(1.0, free))
    force = xp.concat([free[..., :2] * ratio[..., None], normal[..., None]], axis=-1)
    return force, slide, cone, ratio


def sticking_forces(
    maps: Array, wrench: Array, friction: Array, lowest: Array, highest: Array
) -> tuple[Array, Array, Array]:
    """The smallest forces that deliver a wrench exactly, and whether they are within the limits.

    Args:
        maps: (N, 6, 3 P).
        wrench: (N, 6).
        friction: broadcasts to (N, P), as the next two.
        lowest: N, least normal force.
        highest: N, greatest normal force.

    Returns:
        Force (N, P, 3), dual (N, 6), and (N,) bool: they deliver it, and every point sticks.
    """
    xp = namespace(wrench)
    count, _, columns = maps.shape
    gram = maps @ maps.mT + identity(6, maps, _FAINT)
    dual = xp.linalg.solve(gram, wrench[..., None])[..., 0]
    force = (dual[:, None, :] @ maps).reshape(count, columns // 3, 3)
    normal = force[..., 2]
    within = (
        (xp.hypot(force[..., 0], force[..., 1]) <= friction * normal)
        & (normal >= lowest)
        & (normal <= highest)
    )
    # What is missing is _FAINT * dual: all that no force can deliver, else nothing.
    delivered = xp.vecdot(dual, dual) <= (1e-6 / _FAINT) ** 2 * xp.vecdot(wrench, wrench)
    return force, dual, xp.all(within, axis=-1) & delivered


def evaluate(problem: DualProblem, dual: Array) -> DualPoint:
    """Forces and optimality condition at a dual point (N, 6)."""
    maps = problem.wrench_map
    count, _, columns = maps.shape
    free = (dual[:, None, :] @ maps).reshape(count, columns // 3, 3)
    force, slide, cone, ratio = project(free, *problem[2:6])
    missing = (maps @ force.reshape(count, columns, 1))[..., 0] - problem.wrench
    gradient = missing + problem.regularisation * dual
    error = namespace(dual).vecdot(gradient, gradient)
    return DualPoint(dual, free, slide, cone, ratio, force, missing, gradient, error)


def hessian_at(problem: DualProblem, point: DualPoint) -> Array:
    """A generalised Jacobian of the gradient, (N, 6, 6).

    A sticking point passes its force on unchanged, but not a normal force at its bounds. A sliding
    point passes it on along the cone's side (mu r + n, r the direction of sliding), and across r
    scaled by `ratio`.
    """
    xp = namespace(point.dual)
    maps, ratio = problem.wrench_map, point.ratio
    count, _, columns = maps.shape
    normal = point.force[..., 2]
    inside = (normal == point.free[..., 2]) & (ratio >= 1.0)
    factor, passes = ratio[..., None], xp.astype(inside, maps.dtype)[..., None]
    factors = xp.concat([factor, factor, passes], axis=-1).reshape(count, 1, columns)
    hessian = (maps * factors) @ maps.mT + identity(6, maps, problem.regularisation)
    slides = (ratio < 1.0) & (normal > 0.0)
    return hessian + _sliding(problem, point, slides) if slides.any() else hessian


def _sliding(problem: DualProblem, point: DualPoint, slides: Array) -> Array:
    """What sliding points add to the Jacobian: the cone's side, less the radial part in it."""
    xp = namespace(point.dual)
    maps, cone = problem.wrench_map, point.cone
    count, _, columns = maps.shape
    on_side = slides & (cone >= problem.lowest) & (cone <= problem.highest)
    direction = (point.free[..., :2] / point.slide[..., None])[:, None]
    split = maps.reshape(count, 6, columns // 3, 3)
    radial = split[..., 0] * direction[..., 0] + split[..., 1] * direction[..., 1]
    friction = problem.friction
    side = radial * (friction[:, None, :] if friction.ndim == 2 else friction) + split[..., 2]
    along, across = on_side * problem.share, slides * -point.ratio
    left = xp.concat([side * along[:, None], radial * across[:, None]], axis=-1)
    return left @ xp.concat([side, radial], axis=-1).mT


def _line_search(
    problem: DualProblem, point: DualPoint, trial: DualPoint, change: Array, unsolved: Array
) -> DualPoint:
    """Shorten or lengthen Newton steps whose full length is not good enough.

    The dual function is convex with kinks along the line; its slope brackets the minimum. Each
    evaluation projects forces but needs no matrix product.
    """
    xp = namespace(change)
    first = xp.vecdot(change, point.gradient)
    slope = xp.vecdot(change, trial.gradient)
    goal = _SLOPE_REDUCTION * xp.abs(first)
    poor = unsolved & (xp.abs(slope) > goal)
    if not poor.any():
        return trial
    step_free = trial.free - point.free
    count, columns = step_free.shape[0], problem.wrench_map.shape[2]
    flat = step_free.reshape(count, columns, 1)
    growth = problem.regularisation * xp.vecdot(change, change)
    offset = xp.vecdot(change, problem.regularisation * point.dual - problem.wrench)

    # A coarse grid brackets the minimum,
    grid = constant(_STEPS, change)
    free = point.free[:, None] + grid[:, None, None] * step_free[:, None]
    limits = (x[:, None] if x.ndim == 2 else x for x in problem[2:6])
    force = project(free, *limits)[0].reshape(count, len(_STEPS), columns)
    slopes = (force @ flat)[..., 0] + offset[:, None] + growth[:, None] * grid
    last = xp.sum(xp.astype(slopes[:, 1:-1] < 0.0, xp.int64), axis=-1)
    robots = xp.arange(count, device=change.device)
    low, low_slope = grid[last], slopes[robots, last]
    high, high_slope = grid[last + 1], slopes[robots, last + 1]
    # and regula falsi (Illinois) refines it.
    step = constant(1.0, change)
    flat = flat[..., 0]
    for _ in range(_LINE_SEARCH_EVALUATIONS):
        rise = high_slope - low_slope
        inner = low - (high - low) * low_slope / xp.where(rise > 0.0, rise, 1.0)
        step = xp.where(poor, xp.minimum(inner, high), step)
        force = project(point.free + step[:, None, None] * step_free, *problem[2:6])[0]
        slope = offset + step * growth + xp.vecdot(flat, force.reshape(count, columns))
        poor = poor & (xp.abs(slope) > goal)
        if not poor.any():
            break
        short = slope < 0.0
        low_slope = xp.where(short, slope, 0.5 * low_slope)
        high_slope = xp.where(short, 0.5 * high_slope, slope)
        low, high = xp.where(short, step, low), xp.where(short, high, step)
    return evaluate(problem, point.dual + step[:, None] * change)


class DualSolution(NamedTuple):
    """What is kept of the robots."""

    dual: Array  # (N, 6)
    force: Array  # (N, P, 3)
    missing: Array  # (N, 6)
    error: Array  # (N,)
    iterations: Array  # (N,)

    def write(self, rows: Array | None, part: "DualSolution") -> "DualSolution":
        """Replace the solutions of some robots, in place; of all if `rows` is None."""
        if rows is None:
            return part
        for whole, new in zip(self, part, strict=True):
            whole[rows] = new
        return self


def solve_dual(problem: DualProblem, dual: Array, budget: int) -> DualSolution:
    """Improve dual points until each is solved or `budget` steps are spent.

    Solved robots stand still, and leave the batch when the others are few: neither their result nor
    that of the others depends on who else is in the batch.
    """
    xp = namespace(dual)
    point = evaluate(problem, dual)
    unsolved = point.error > problem.tolerance
    taken = xp.zeros(unsolved.shape, dtype=xp.int64, device=dual.device)
    solution = DualSolution(point.dual, point.force, point.missing, point.error, taken)
    rows = None  # indices of the robots still in the batch; None while it is all of them
    for _ in range(budget):
        if not unsolved.any():
            break
        change = -xp.linalg.solve(hessian_at(problem, point), point.gradient[..., None])[..., 0]
        change = xp.where(unsolved[:, None], change, 0.0)
        trial = evaluate(problem, point.dual + change)
        taken = taken + xp.astype(unsolved, xp.int64)
        unsolved = unsolved & (trial.error > problem.tolerance)
        remaining = int(unsolved.sum())
        if 0 < 2 * remaining <= unsolved.shape[0]:
            leaving = DualSolution(trial.dual, trial.force, trial.missing, trial.error, taken)
            solution = solution.write(rows, leaving)
            keep = xp.nonzero(unsolved)[0]
            rows = keep if rows is None else rows[keep]
            problem, point, trial = problem.rows(keep), point.rows(keep), trial.rows(keep)
            change, taken, unsolved = change[keep], taken[keep], unsolved[keep]
        if remaining:
            trial = _line_search(problem, point, trial, change, unsolved)
            unsolved = unsolved & (trial.error > problem.tolerance)
        point = trial
    last = DualSolution(point.dual, point.force, point.missing, point.error, taken)
    return solution.write(rows, last)
