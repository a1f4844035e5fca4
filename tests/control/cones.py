"""Contact forces by the solver that the laws share, nothing around it; and by Clarabel."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import clarabel
import numpy as np
from scipy import sparse

from fbid_gym.control import Accuracy, ContactLimits
from fbid_gym.control.contact_forces import (
    DEFAULT_ACCURACY,
    limits_in_contact,
    point_limits,
    wrench_scale,
)
from fbid_gym.control.dual_newton import Forces, Problem, deliver


def wrench_map_of(arm: np.ndarray) -> np.ndarray:
    """(N, 6, 3 P) force and moment of forces on points, `arm` (N, P, 3) from where they count."""
    rows = np.zeros((len(arm), 6, arm.shape[1], 3))
    rows[:, :3] = np.eye(3)[:, None]
    for axis in range(3):
        rows[:, 3:, :, axis] = np.cross(arm, np.eye(3)[axis]).mT
    return rows.reshape(len(arm), 6, -1)


class ContactForces(NamedTuple):
    """Feasible contact forces and how well they deliver the wrench."""

    force: np.ndarray  # (N, P, 3) N, two tangential components, then the normal one
    wrench: np.ndarray  # (N, 6) what they deliver, N and N·m
    residual: np.ndarray  # (N,) weighted distance from the desired wrench, per weight
    iterations: np.ndarray  # (N,) Newton steps
    dual: np.ndarray  # (N, 6) warm start for the next call


def contact_forces(
    wrench_map: np.ndarray,
    wrench: np.ndarray,
    limits: ContactLimits,
    *,
    weight: float,
    length: float,
    wrench_cost: Sequence[float] | np.ndarray | None = None,
    active: np.ndarray | None = None,
    warm_start: np.ndarray | None = None,
    accuracy: Accuracy = DEFAULT_ACCURACY,
) -> ContactForces:
    """Forces within limits that best deliver wrenches (N, 6); wrench_map (N, 6, 3 P)."""
    count, points = len(wrench), wrench_map.shape[2] // 3
    own, scale = point_limits(limits, active, count, points), wrench_scale(length, wrench_cost)
    start = np.zeros((count, 6)) if warm_start is None else warm_start
    values = np.empty((points, 3))
    force, missing = np.empty((count, points, 3)), np.empty((count, 6))
    iterations, dual = np.empty(count, int), np.empty((count, 6))
    # Points that are not in contact have zero columns, as in `ReducedContacts.point_map`.
    maps = wrench_map * np.repeat(np.broadcast_to(own.active, (count, points)), 3, axis=1)[:, None]
    for i in range(count):
        limits_in_contact(own, i, values)
        problem = Problem(scale[:, None] * maps[i], scale * wrench[i], values)
        found = Forces(force[i], missing[i], dual[i])
        iterations[i] = deliver(problem, accuracy, weight, start[i], found)
    residual = np.linalg.norm(missing, axis=1) / weight
    return ContactForces(force, wrench + missing / scale, residual, iterations, dual)


def solved_by_clarabel(
    maps: np.ndarray,
    target: np.ndarray,
    limits: np.ndarray,
    scale: float,
    *,
    torque: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None,
    tolerance: float = 1e-12,
) -> np.ndarray | None:
    """Forces f (3 P,) that minimise |maps f - target|^2 + regularisation |f|^2 within limits, in N.

    None where there are none. The squares are of f in units of `scale` N.

    Args:
        maps: (m, 3 P) of forces in `scale` N.
        target: (m,).
        limits: (P, 3) friction, least and greatest normal force in N, of each point.
        scale: N.
        torque: slope (n, 3 P) m, least and greatest value (n,) N·m of slope f.
        tolerance: of the solver.
    """
    rows, bounds, cones = list[np.ndarray](), list[float](), list[Any]()
    for i, (friction, lowest, highest) in enumerate(limits):
        along_x, along_y, normal = np.eye(3 * len(limits))[3 * i : 3 * i + 3]
        capped = int(np.isfinite(highest))
        rows += [-normal, *[normal] * capped, -friction * normal, -along_x, -along_y]
        bounds += [-lowest, *[highest] * capped, 0.0, 0.0, 0.0]
        cones += [clarabel.NonnegativeConeT(1 + capped), clarabel.SecondOrderConeT(3)]
    if torque is not None:
        slope, least, most = torque
        rows, bounds = [*rows, *slope, *-slope], [*bounds, *most, *-least]
        cones.append(clarabel.NonnegativeConeT(2 * len(slope)))
    size = maps.shape[1]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(maps.T @ maps + DEFAULT_ACCURACY.regularisation * np.eye(size))),
        -maps.T @ target,
        sparse.csc_matrix(np.array(rows)),
        np.array(bounds) / scale,
        cones,
        settings,
    ).solve()
    solved = str(solution.status) in ("Solved", "AlmostSolved")
    return scale * np.array(solution.x) if solved else None
