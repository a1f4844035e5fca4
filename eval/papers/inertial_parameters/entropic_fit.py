"""Least squares over bodies that can exist: a quadratic plus the entropic divergence.

    minimise |A x - b|^2 / 2 + w sum_b D(Z_b),
    Z_b = 1 + sum_k x_bk E_k,   D(Z) = tr Z - log det Z - 4

over changes x of B bodies in natural steps (`excitation`): Z_b = L^-1 P_b L^-T is the
pseudo-inertia of body b relative to the nominal one, L L^T. D is zero at the nominal body, half the
square of a small change, and infinite for a body that cannot exist.

With a weight that falls tenfold from one round to the next, Newton's method follows the minimum to
that of the weight asked for; -log det is self-concordant, so that its steps, damped, stay inside.
A step is a linear least-squares problem in A and the square root of D's Hessian: nothing is
squared, and directions that the data hardly tell come out as exactly as the data allow.
"""

import numpy as np

from eval.papers.inertial_parameters.excitation import BASIS

_MOST_STEPS = 1000
_FIRST_WEIGHT, _FALL = 1.0, 0.1
_CENTRED, _CONVERGED, _STALLED = 0.1, 1e-8, 1e-4


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
    moved, now = effect @ directions, max(_FIRST_WEIGHT, weight)
    before = np.inf
    for _ in range(_MOST_STEPS):
        root = np.linalg.cholesky(relative_inertia(change))
        inverse = np.linalg.inv(root)[:, None]
        # D's Hessian is metric^T metric, its gradient -metric^T pull.
        metric = _block_diagonal(_coordinates(inverse @ BASIS @ inverse.mT).mT) @ directions
        pull = _coordinates(np.eye(4) - root.mT @ root).ravel()
        scaled = np.sqrt(now) * np.concatenate([metric, pull[:, None]], axis=1)
        left = np.concatenate([moved, scaled[:, :-1]])
        step, *_ = np.linalg.lstsq(
            left, np.concatenate([error - effect @ change, scaled[:, -1]]), rcond=None
        )
        decrement = float(np.linalg.norm(left @ step) / np.sqrt(now))
        change = change + directions @ step / (1.0 + (decrement if decrement > 0.25 else 0.0))
        if now > weight:
            now = max(weight, _FALL * now) if decrement < _CENTRED else now
        elif decrement < _CONVERGED or before / 2.0 < decrement < _STALLED:
            break  # it falls quadratically until rounding
        before = decrement
    return change


def _coordinates(matrices: np.ndarray) -> np.ndarray:
    """Coordinates (..., 10) of symmetric matrices (..., 4, 4) in the basis."""
    return np.tensordot(matrices, BASIS, axes=((-2, -1), (1, 2)))


def _block_diagonal(blocks: np.ndarray) -> np.ndarray:
    """One matrix (10 B, 10 B) from (B, 10, 10)."""
    count = len(blocks)
    result = np.zeros((count, 10, count, 10))
    result[np.arange(count), :, np.arange(count)] = blocks
    return result.reshape(10 * count, 10 * count)
