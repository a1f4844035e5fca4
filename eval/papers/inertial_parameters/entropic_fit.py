"""Least squares over bodies that can exist: a quadratic plus the entropic divergence.

    minimise |A x - b|^2 / 2 + w sum_b D(Z_b),
    Z_b = 1 + sum_k x_bk E_k,   D(Z) = tr Z - log det Z - 4

over changes x of B bodies in natural steps (`excitation`): Z_b = L^-1 P_b L^-T is
the pseudo-inertia of body b relative to the nominal one, L L^T. D is zero at the nominal body, half
the square of a small change, and infinite for a body that cannot exist.

The minimum is a point of the central path of the semidefinite programme without D's logarithm, so a
primal-dual interior-point method walks to it: with dual matrices V_b it solves

    A^T (A x - b) + w E^T 1 - E^T V = 0,   Z_b V_b = w 1

by Newton's method in Nesterov and Todd's scaling, which treats Z and V alike (Y. E. Nesterov,
M. J. Todd, "Primal-dual interior-point methods for self-scaled cones", SIAM J. Optimization 8(2),
1998). A Newton step is a linear least-squares problem, so nothing is squared, and directions that
the data hardly tell come out as exactly as the data allow.
"""

import numpy as np
from scipy.linalg import block_diag

from eval.papers.inertial_parameters.excitation import BASIS

_MAX_STEPS = 200
_CONVERGED, _STALLED = 1e-8, 1e-2
_TO_BORDER = 0.9
_LEAST_CENTRING, _MOST_CENTRING = 0.05, 0.9


def relative_inertia(change: np.ndarray) -> np.ndarray:
    """Return pseudo-inertias relative to the nominal ones, Z (B, 4, 4), of changes (10 B,)."""
    return np.eye(4) + np.tensordot(change.reshape(-1, 10), BASIS, axes=1)


def fit(
    effect: np.ndarray,
    error: np.ndarray,
    weight: float,
    weighed: tuple[np.ndarray, float] | None = None,
) -> np.ndarray:
    """Minimise |effect x - error|^2 / 2 + weight * sum_b D_b(x).

    Args:
        effect: (r, 10 B) A, of order one.
        error: (r,) b, of order one.
        weight: w, positive.
        weighed: to hold the total mass: (10 B,) kg that each step adds to it, and its ratio to the
            nominal one.

    Returns:
        x: (10 B,), of bodies that can exist.
    """
    count = effect.shape[1] // 10
    change, directions = np.zeros(10 * count), np.eye(10 * count)
    if weighed is not None:
        # All bodies in proportion have the right mass; from there in directions that keep it.
        steps, ratio = weighed
        change = np.tile(_coordinates(np.eye(4) * (ratio - 1.0)), count)
        directions = np.linalg.svd(steps[None])[2][1:].T
    moved = effect @ directions
    dual = max(1.0, weight) * np.linalg.inv(relative_inertia(change))
    centring, before, share = _MOST_CENTRING, np.inf, np.sqrt(weight)
    possible = change
    for _ in range(_MAX_STEPS):
        try:
            scaling, inverse, size = _balanced(relative_inertia(change), dual)
        except np.linalg.LinAlgError:  # at the border to rounding: there is nothing left to gain
            return possible
        possible = change
        gap = float(np.mean(size**2))
        aim = max(weight, centring * gap)
        target = aim / size[:, None] * np.eye(4)  # (B, 4, 4), aim D^-1
        metric = block_diag(*_coordinates(_between(inverse[:, None], BASIS)).mT) @ directions
        step, *_ = np.linalg.lstsq(
            np.concatenate([moved, metric]),
            np.concatenate(
                [
                    error - effect @ change,
                    _coordinates(target - weight * scaling.mT @ scaling).ravel(),
                ]
            ),
            rcond=None,
        )
        move = directions @ step
        primal = _between(inverse, relative_inertia(move) - np.eye(4))
        opposite = target - size[:, None] * np.eye(4) - primal
        length = min(1.0, _TO_BORDER * min(_room(primal, size), _room(opposite, size)))
        change = change + length * move
        dual = dual + length * _between(inverse.mT, opposite)
        centring = np.clip((1.0 - length) ** 2, _LEAST_CENTRING, _MOST_CENTRING)
        if aim > weight or length < 1.0:
            continue
        # The Newton decrement, relative to the prior; it falls quadratically until rounding.
        decrement = np.hypot(np.linalg.norm(moved @ step), np.linalg.norm(metric @ step)) / share
        if decrement < _CONVERGED or before / 2 < decrement < _STALLED:
            break
        before = decrement
    return change


def _balanced(relative: np.ndarray, dual: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scaling G (B, 4, 4), its inverse, and D (B, 4) with G^-1 Z G^-T = G^T V G = diag D."""
    first, second = np.linalg.cholesky(relative), np.linalg.cholesky(dual)
    _, size, right = np.linalg.svd(second.mT @ first)
    root = np.sqrt(size)
    inverse = root[:, :, None] * (right @ np.linalg.inv(first))
    return (first @ right.mT) / root[:, None], inverse, size


def _room(step: np.ndarray, size: np.ndarray) -> float:
    """Count how often a scaled step (B, 4, 4) fits between diag D and the border."""
    root = np.sqrt(size)
    relative = step / root[:, :, None] / root[:, None]
    return float(1.0 / max(-np.linalg.eigvalsh(relative).min(), 1e-12))


def _between(left: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    """Left M left^T."""
    return np.asarray(left @ matrices @ left.mT)


def _coordinates(matrices: np.ndarray) -> np.ndarray:
    """Coordinates (..., 10) of symmetric matrices (..., 4, 4) in the basis."""
    return np.tensordot(matrices, BASIS, axes=((-2, -1), (1, 2)))
