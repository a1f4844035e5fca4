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

from fbid_gym.compiled import compiled
from fbid_gym.control.dual_newton import Problem, nearest_force
from fbid_gym.dynamics.vectors import store, vector
from fbid_gym.quantities import Accuracy
from fbid_gym.small_matrices import (
    add_transposed_times,
    dot,
    factor,
    lift,
    multiply_transposed,
    solve_factored_columns,
    times,
)

# Penalties on forces (per weight) that leave the cones, and torques (per weight, rows of A at unit
# length) that leave the box; found by trial on all built-in robots.
_FORCE_PENALTY = 1.0
_TORQUE_PENALTY = 10.0
_OVERRELAXATION = 1.6
_FAINT = 1e-9  # of the longest lever arm: shorter ones do not count


class AffineTorque(NamedTuple):
    """Torques of one robot as a function of its point forces, and their limits."""

    slope: np.ndarray  # (n, 3 P) A, N·m per N
    offset: np.ndarray  # (n,) N·m
    limit: np.ndarray  # (n,) N·m, symmetric


@compiled
def forces_within_torque_limits(
    problem: Problem, motors: AffineTorque, weight: float, accuracy: Accuracy, force: np.ndarray
) -> None:
    """Overwrite contact forces of one robot with those that best deliver a wrench within limits.

    Args:
        problem: the wrench and the limits of the points.
        motors: the torques that go with the forces.
        weight: N.
        accuracy: its `regularisation` and `torque_steps`.
        force: (3 P,) N, where to start: the solution without torque limits.
    """
    joints, columns = motors.slope.shape
    rows, lowest, highest = np.empty((joints, columns)), np.empty(joints), np.empty(joints)
    levers, longest, count = np.empty(joints), 0.0, 0
    for j in range(joints):
        levers[j] = np.sqrt(dot(motors.slope[j], motors.slope[j]))
        longest = max(longest, levers[j])
    for j in range(joints):
        if levers[j] > 0.0:  # else no force changes its torque
            size = levers[j] + _FAINT * longest
            for i in range(columns):
                rows[count, i] = motors.slope[j, i] / size
            lowest[count] = (-motors.limit[j] - motors.offset[j]) / size / weight
            highest[count] = (motors.limit[j] - motors.offset[j]) / size / weight
            count += 1
    if count == 0:
        return
    rows, lowest, highest = rows[:count], lowest[:count], highest[:count]
    cones, target = np.empty(problem.limits.shape), np.zeros(columns)
    add_transposed_times(problem.maps, problem.wrench, target)
    for i in range(columns):
        # All but the friction coefficient, per weight.
        cones[i // 3, i % 3] = problem.limits[i // 3, i % 3] / (weight if i % 3 else 1.0)
        target[i], force[i] = target[i] / weight, force[i] / weight
    inverse = _inverse(problem.maps, rows, accuracy.regularisation)
    _split(inverse, rows, target, lowest, highest, cones, force, accuracy.torque_steps)
    for i in range(columns):
        force[i] *= weight


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
    lift(lower, regularisation + _FORCE_PENALTY)
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
    kept = np.empty(joints)
    for j in range(joints):
        kept[j] = np.minimum(np.maximum(torque[j], lowest[j]), highest[j])
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
            nearest = nearest_force(vector(free, (), 3 * point), vector(limits, (point,)))
            store(nearest.force, inside, (), 3 * point)
        for i in range(columns):
            force_debt[i] = free[i] - inside[i]


@compiled
def _relaxed(new: float, old: float) -> float:
    return _OVERRELAXATION * new + (1.0 - _OVERRELAXATION) * old
