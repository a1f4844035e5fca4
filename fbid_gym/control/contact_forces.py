"""Contact forces that friction and unilaterality allow: a batched cone-constrained least squares.

The forces f_i of the contact points shall deliver a base wrench w as well as they can:

    minimise 1/2 (G f - w)^T S (G f - w) + eps/2 |f|^2   subject to   f_i in C_i,
    C_i = {|tangential force| <= mu * normal force, lowest <= normal force <= highest}.

Mostly the smallest forces that deliver w lie within the limits. They are tried first, unless a
force was at a limit a tick ago. Otherwise there are many forces, but only six numbers in w: with
y = S (w - G f), the optimal forces are the projection f = Pi_C(G^T y / eps), which acts on each
point alone, and what remains is one equation in six unknowns, S^-1 y + G Pi_C(G^T y / eps) = w. Its
left side is the gradient of a strongly convex function and piecewise smooth, so a semismooth Newton
method with a line search solves it in about as many 6x6 solves as points change between sticking,
sliding and lifting. Every iterate is feasible, because it is a projection.

How exact that is: with the default tolerance the wrench is that of the optimum to 1e-6 of the
weight (in each of 480,000 random problems, cold and infeasible ones among them). The default eps
moves the optimum itself by up to 1e-3 of the weight while points slide or lift, typically by 1e-4,
and not at all while they stick. Where Newton's method does not get there, forces are finite and
feasible, and no worse than those of the warm start.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from fbid_gym.checks import check_shape, positive_numbers
from fbid_gym.compiled import compiled
from fbid_gym.control.equations import fitted
from fbid_gym.errors import InvalidValueError, ShapeError
from fbid_gym.quantities import Accuracy, PointLimits

DEFAULT_ACCURACY = Accuracy(regularisation=1e-4, tolerance=1e-6, max_iterations=8, torque_steps=24)
_LARGEST = float(np.finfo(np.float64).max)


@dataclass(frozen=True, eq=False)
class ContactLimits:
    """Forces that a contact point can transmit. Each entry is a number or broadcasts to (N, P).

    Arrays are copied, and read-only.

    Attributes:
        friction: friction coefficient mu: |tangential force| <= mu * normal force.
        min_normal_force: N, least normal force of a point in contact.
        max_normal_force: N, greatest normal force; infinity for none.

    Raises:
        InvalidValueError: an entry is negative or NaN, friction or the minimum is infinite, or the
            minimum exceeds the maximum.
    """

    friction: Any = 0.7
    min_normal_force: Any = 0.0
    max_normal_force: Any = np.inf

    def __post_init__(self) -> None:
        """Convert to arrays and validate."""
        for name in ("friction", "min_normal_force", "max_normal_force"):
            given, largest = getattr(self, name), np.inf if name == "max_normal_force" else _LARGEST
            try:
                value = np.array(given, dtype=np.float64)
                valid = bool(np.all((value >= 0.0) & (value <= largest)))
            except (TypeError, ValueError):
                valid = False
            if not valid:
                finite = "" if largest == np.inf else "finite "
                raise InvalidValueError(name, given, f"{finite}numbers of at least 0")
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        try:
            ordered = bool(np.all(self.min_normal_force <= self.max_normal_force))
        except ValueError:
            ordered = False
        if not ordered:
            expected = f"at most max_normal_force, {self.max_normal_force}"
            raise InvalidValueError("min_normal_force", self.min_normal_force, expected)


def wrench_scale(length: float, wrench_cost: Sequence[float] | np.ndarray | None) -> np.ndarray:
    """(6,) factors that turn N and N·m into N whose squares are comparable.

    Raises:
        InvalidValueError: `length` or `wrench_cost` is not positive and finite.
    """
    arm = positive_numbers("length", length, 1)
    cost = positive_numbers("wrench_cost", (1.0,) * 6 if wrench_cost is None else wrench_cost, 6)
    return np.sqrt(cost) / np.repeat([1.0, arm[0]], 3)


def point_limits(
    limits: ContactLimits, active: np.ndarray | None, count: int, points: int
) -> PointLimits:
    """Return limits as compiled code takes them; active points (N, P), all if None.

    Raises:
        ShapeError: limits or active points do not fit (N, P).
    """
    for name in ("friction", "min_normal_force", "max_normal_force"):
        shape = getattr(limits, name).shape
        if shape not in ((), (1,), (points,), (1, points), (count, 1), (count, points)):
            raise ShapeError(name, shape, f"a number, (P,) or (N, P) = {(count, points)}")
    given = np.ones((1, points), bool) if active is None else active
    if active is not None:
        check_shape("active", given, (count, points), "(N, P)")
    return PointLimits(limit_rows(limits, points), np.ascontiguousarray(given, bool))


def fitted_point_map(point_map: np.ndarray, sizes: Mapping[str, int]) -> np.ndarray:
    """Return a map (N, k, 3 P) from forces on points to contact rows, for any P.

    Raises:
        ShapeError: it does not fit N and k, or has other than 3 P columns.
    """
    columns = point_map.shape[-1]
    if columns % 3:
        raise ShapeError("point_map", tuple(point_map.shape), "3 P columns")
    return fitted("point_map", point_map, "(N, k, 3 P)", {**sizes, "3 P": columns})


@lru_cache(maxsize=256)
def limit_rows(limits: ContactLimits, points: int) -> np.ndarray:
    """(N, P, 3), or (1, P, 3) for all robots: friction, lowest and highest normal force."""
    numbers = (limits.friction, limits.min_normal_force, limits.max_normal_force)
    rows = np.stack(np.broadcast_arrays(*numbers, np.empty((1, points)))[:3], axis=-1)
    return np.ascontiguousarray(rows)


@compiled
def limits_in_contact(limits: PointLimits, robot: int, values: np.ndarray) -> None:
    """Write the limits of a robot's points, zero where they are not in contact, to (P, 3)."""
    row = limits.rows[min(robot, len(limits.rows) - 1)]
    present = limits.active[min(robot, len(limits.active) - 1)]
    for i in range(len(values)):
        for axis in range(3):
            values[i, axis] = row[i, axis] if present[i] else 0.0
