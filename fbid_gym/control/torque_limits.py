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

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.control.dual_newton import nearest_force
from fbid_gym.small_matrices import (
    add_transposed_times,
    dot,
    factor,
    multiply_transposed,
    solve_factored_columns,
    times,
)

STEPS = 24
# Penalties on forces (per weight) that leave the cones, and torques (per weight, rows of A at unit
# length) that leave the box; found by trial on all built-in robots.
_FORCE_PENALTY = 1.0
_TORQUE_PENALTY = 10.0
_OVERRELAXATION = 1.6
_FAINT = 1e-9


@compiled
def forces_within_torque_limits(
    maps: np.ndarray,
    wrench: np.ndarray,
    limits: np.ndarray,
    slope: np.ndarray,
    offset: np.ndarray,
    torque_limit: np.ndarray,
    weight: float,
    regularisation: float,
    steps: int,
    force: np.ndarray,
) -> None:
    """Overwrite contact forces of one robot with those that best deliver a wrench within limits.

    Args:
        maps: (6, 3 P) scaled.
        wrench: (6,) scaled.
        limits: (P, 3) friction coefficient, least and greatest normal force.
        slope: (n, 3 P) A of the torques, N m per N.
        offset: (n,) N m of the torques.
        torque_limit: (n,) N m, symmetric.
        weight: N.
        regularisation: see `limited_contact_forces`.
        steps: of the iteration.
        force: (3 P,) N, where to start: the solution without torque limits.
    """
    joints, columns = slope.shape
    rows, lowest, highest = np.empty_like(slope), np.empty(joints), np.empty(joints)
    for j in range(joints):
        size = np.sqrt(dot(slope[j], slope[j])) + _FAINT
        for i in range(columns):
            rows[j, i] = slope[j, i] / size
        lowest[j] = (-torque_limit[j] - offset[j]) / size / weight
        highest[j] = (torque_limit[j] - offset[j]) / size / weight
    cones = limits.copy()
    cones[:, 1:] /= weight
    target = np.zeros(columns)
    add_transposed_times(maps, wrench, target)
    inverse = _inverse(maps, rows, regularisation)
    force /= weight
    _split(inverse, rows, target / weight, lowest, highest, cones, force, steps)
    force *= weight


@compiled
def _inverse(maps: np.ndarray, rows: np.ndarray, regularisation: float) -> np.ndarray:
    """Of the matrix of the least squares, (3 P, 3 P)."""
    columns = maps.shape[1]
    lower, torques = np.empty((columns, columns)), np.empty((columns, columns))
    multiply_transposed(maps, maps, lower)
    multiply_transposed(rows, rows, torques)
    inverse = np.zeros((columns, columns))
    for i in range(columns):
        for j in range(i + 1):
            lower[i, j] += _TORQUE_PENALTY * torques[i, j]
        lower[i, i] += regularisation + _FORCE_PENALTY
        inverse[i, i] = 1.0
    factor(lower)
    solve_factored_columns(lower, inverse)
    return inverse


@compiled
def _split(
    inverse: np.ndarray,
    rows: np.ndarray,
    target: np.ndarray,
    lowest: np.ndarray,
    highest: np.ndarray,
    limits: np.ndarray,
    inside: np.ndarray,
    steps: int,
) -> None:
    """The iteration, in forces per weight; it starts and ends with those in `inside` (3 P,)."""
    joints, columns = rows.shape
    free, force_debt, pull = np.empty(columns), np.zeros(columns), np.empty(columns)
    torque, torque_debt, push = np.empty(joints), np.zeros(joints), np.empty(joints)
    times(rows, inside, torque)
    kept = np.minimum(np.maximum(torque, lowest), highest)
    for _ in range(steps):
        for j in range(joints):
            push[j] = _TORQUE_PENALTY * (kept[j] - torque_debt[j])
        for i in range(columns):
            pull[i] = target[i] + _FORCE_PENALTY * (inside[i] - force_debt[i])
        add_transposed_times(rows, push, pull)
        times(inverse, pull, free)
        times(rows, free, torque)
        for j in range(joints):
            torque[j] = _relaxed(torque[j], kept[j]) + torque_debt[j]
            kept[j] = np.minimum(np.maximum(torque[j], lowest[j]), highest[j])
            torque_debt[j] = torque[j] - kept[j]
        for i in range(columns):
            free[i] = _relaxed(free[i], inside[i]) + force_debt[i]
        for point in range(len(limits)):
            part = slice(3 * point, 3 * point + 3)
            nearest_force(free[part], limits[point], inside[part])
        for i in range(columns):
            force_debt[i] = free[i] - inside[i]


@compiled
def _relaxed(new: float, old: float) -> float:
    return _OVERRELAXATION * new + (1.0 - _OVERRELAXATION) * old
