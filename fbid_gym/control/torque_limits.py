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

from fbid_gym.control.arrays import Array, identity, matvec, namespace
from fbid_gym.control.dual_newton import DualProblem, project

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
    count, columns = force.shape
    weight = weight[:, None] if weight.ndim else weight
    size = xp.sqrt(xp.vecdot(torques.slope, torques.slope)) + _FAINT
    slope = torques.slope / size[..., None]
    centre, half = torques.offset / size / weight, torques.limit / size / weight
    maps = problem.wrench_map
    matrix = maps.mT @ maps + _TORQUE_PENALTY * (slope.mT @ slope)
    matrix = matrix + identity(columns, matrix, problem.regularisation + _FORCE_PENALTY)
    inverse = xp.linalg.inv(matrix)
    target = matvec(maps.mT, problem.wrench / weight)
    back = _TORQUE_PENALTY * slope.mT
    limits = (problem.friction, problem.share, problem.lowest / weight, problem.highest / weight)

    inside = force / weight
    kept = xp.clip(matvec(slope, inside), -half - centre, half - centre)
    force_debt, torque_debt = xp.zeros_like(inside), xp.zeros_like(kept)
    for _ in range(steps):
        free = target + _FORCE_PENALTY * (inside - force_debt) + matvec(back, kept - torque_debt)
        free = matvec(inverse, free)
        torque = _OVERRELAXATION * matvec(slope, free) + (1.0 - _OVERRELAXATION) * kept
        free = _OVERRELAXATION * free + (1.0 - _OVERRELAXATION) * inside + force_debt
        torque = torque + torque_debt
        inside = project(free.reshape(count, columns // 3, 3), *limits)[0].reshape(force.shape)
        kept = xp.clip(torque, -half - centre, half - centre)
        force_debt, torque_debt = free - inside, torque - kept
    return inside * weight
