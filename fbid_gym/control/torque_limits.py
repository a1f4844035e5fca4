"""Contact forces under torque limits: the same least squares, with the torques' bounds beside it.

Where torques are affine in the contact forces, tau = offset + A f, limits on them are linear and
couple all contact points, so that the small dual of `contact_forces` is lost. What remains is
convex, and solved by splitting (ADMM): a linear least squares in f, whose matrix is inverted once,
takes turns with two projections that are each exact, of f onto the friction cones and of A f onto
the box of the limits. Every iterate, the last one included, lies in the cones.

The number of steps is fixed, so that a robot in a hopeless state costs no more than any other. The
default leaves the wrench within about a hundredth of the weight of the optimum and torques within
a few hundredths of their limits (medians and worst cases in the tests); more steps converge. If
cones and limits contradict each other, the result is a compromise between both.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.control.arrays import Array, as_numpy, from_numpy, identity, matvec, namespace
from fbid_gym.control.dual_newton import DualProblem, compiled, nearest_force

STEPS = 24
# Penalties on forces (per weight) that leave the cones, and torques (per weight, rows of A at unit
# length) that leave the box; found by trial on all built-in robots.
_FORCE_PENALTY = 1.0
_TORQUE_PENALTY = 10.0
_OVERRELAXATION = 1.6
_FAINT = 1e-9


class TorqueLimits(NamedTuple):
    """Bounds on torques that are affine in the contact forces.

    Attributes:
        slope: (N, n, 3 P) A, N m per N.
        offset: (N, n) N m.
        limit: (N, n) N m, symmetric.
    """

    slope: Array
    offset: Array
    limit: Array


def forces_within_torque_limits(
    problem: DualProblem, torques: TorqueLimits, force: Array, weight: Array, steps: int
) -> Array:
    """Return contact forces within the cones that best deliver the wrench within torque limits.

    Args:
        problem: the scaled wrench and the limits of the contact points.
        torques: their limits.
        force: (N, 3 P) N, where to start: the solution without torque limits.
        weight: N, (N,) or ().
        steps: of the iteration.

    Returns:
        (N, 3 P) N.
    """
    xp = namespace(force)
    weight = weight[:, None] if weight.ndim else weight
    size = xp.sqrt(xp.vecdot(torques.slope, torques.slope)) + _FAINT
    slope = torques.slope / size[..., None]
    centre, half = torques.offset / size / weight, torques.limit / size / weight
    maps = problem.wrench_map
    matrix = maps.mT @ maps + _TORQUE_PENALTY * (slope.mT @ slope)
    matrix = matrix + identity(force.shape[1], matrix, problem.regularisation + _FORCE_PENALTY)
    inverse = xp.linalg.inv(matrix)
    target = matvec(maps.mT, problem.wrench / weight)
    limits = problem.limits / xp.stack([xp.ones_like(weight), weight, weight], axis=-1)
    arrays = (inverse, slope, slope.mT, target, -half - centre, half - centre, limits)
    inside = _split(*(as_numpy(x) for x in arrays), as_numpy(force / weight), steps)
    return from_numpy(inside, like=force) * weight


@compiled
def _add_product(columns: np.ndarray, factors: np.ndarray, total: np.ndarray) -> None:
    """Add a matrix times a vector to `total`; the matrix by its columns."""
    for column, factor in zip(columns, factors):  # noqa: B905, compiled code knows no `strict`
        for i in range(len(total)):
            total[i] += factor * column[i]


@compiled
def _split(
    inverse: np.ndarray,
    slope: np.ndarray,
    slope_transposed: np.ndarray,
    target: np.ndarray,
    lowest: np.ndarray,
    highest: np.ndarray,
    limits: np.ndarray,
    start: np.ndarray,
    steps: int,
) -> np.ndarray:
    """The iteration, in forces per weight, one robot after another."""
    result, torque, free = start.copy(), np.empty(slope.shape[1]), np.empty(start.shape[1])
    for robot in range(len(start)):
        rows, columns, inside = slope[robot], slope_transposed[robot], result[robot]
        torque[:] = 0.0
        _add_product(columns, inside, torque)
        kept = np.minimum(np.maximum(torque, lowest[robot]), highest[robot])
        force_debt, torque_debt = np.zeros_like(inside), np.zeros_like(kept)
        for _ in range(steps):
            pull = target[robot] + _FORCE_PENALTY * (inside - force_debt)
            _add_product(rows, _TORQUE_PENALTY * (kept - torque_debt), pull)
            free[:], torque[:] = 0.0, 0.0
            _add_product(inverse[robot], pull, free)
            _add_product(columns, free, torque)
            torque[:] = _OVERRELAXATION * torque + (1.0 - _OVERRELAXATION) * kept + torque_debt
            free[:] = _OVERRELAXATION * free + (1.0 - _OVERRELAXATION) * inside + force_debt
            for i in range(limits.shape[1]):
                part = slice(3 * i, 3 * i + 3)
                nearest_force(free[part], limits[robot, i], inside[part])
            kept[:] = np.minimum(np.maximum(torque, lowest[robot]), highest[robot])
            force_debt[:], torque_debt[:] = free - inside, torque - kept
    return result
