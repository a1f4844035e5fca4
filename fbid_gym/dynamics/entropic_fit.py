"""Least squares over bodies that can exist: a quadratic plus the entropic divergence.

    minimise |A x - b|^2 / 2 + w sum_b D(Z_b),
    Z_b = 1 + sum_k x_bk E_k,   D(Z) = tr Z - log det Z - 4

over changes x of B bodies in natural steps (`fbid_gym.dynamics.excitation`): Z_b = L^-1 P_b L^-T is
the pseudo-inertia of body b relative to the nominal one, L L^T. D is zero at the nominal body, half
the square of a small change, and infinite for a body that cannot exist.

The function is convex, and self-concordant after division by w, so Newton's method with a line
search finds its minimum from anywhere inside. Each step is a linear least-squares problem: nothing
is squared, and directions that the data hardly tell are as exact as the data.
"""

from typing import NamedTuple

import numpy as np

from fbid_gym.dynamics.excitation import BASIS

_MAX_STEPS = 100
_ROUGH, _CONVERGED = 0.1, 1e-9
_SHORTEST = 1e-9
_SINGULAR = 1e-13


class Weighed(NamedTuple):
    """A total mass that the bodies shall have.

    Attributes:
        steps: (10 B,) kg, what each natural step adds to the total mass.
        total: kg, wanted.
        nominal: kg, of the nominal bodies.
    """

    steps: np.ndarray
    total: float
    nominal: float


def relative_inertia(change: np.ndarray) -> np.ndarray:
    """Pseudo-inertias relative to the nominal ones, Z (B, 4, 4), of changes (10 B,)."""
    return np.eye(4) + np.tensordot(change.reshape(-1, 10), BASIS, axes=1)


def divergence(relative: np.ndarray) -> np.ndarray:
    """Entropic divergence D (B,) of bodies from the nominal ones; infinite where none can exist.

    Args:
        relative: (B, 4, 4) Z of each body.
    """
    sizes = np.linalg.eigvalsh(relative)
    possible = sizes[:, 0] > _SINGULAR * sizes[:, -1]
    sizes = np.where(possible[:, None], sizes, 1.0)
    return np.where(possible, (sizes - np.log(sizes) - 1.0).sum(axis=1), np.inf)


def fit(
    effect: np.ndarray, error: np.ndarray, weight: float, weighed: Weighed | None = None
) -> np.ndarray:
    """Minimise |effect x - error|^2 / 2 + weight * sum_b D_b(x).

    The weight comes down from one by factors of a hundred, each minimum the start of the next.

    Args:
        effect: (r, 10 B) A.
        error: (r,) b.
        weight: w, positive.
        weighed: a total mass to hold exactly, if any.

    Returns:
        x: (10 B,), of bodies that can exist.
    """
    change, directions = np.zeros(effect.shape[1]), np.eye(effect.shape[1])
    if weighed is not None:
        # All bodies in proportion have the right mass; from there in directions that keep it.
        change = _coordinates(np.eye(4) * (weighed.total / weighed.nominal - 1.0))
        change = np.tile(change, effect.shape[1] // 10)
        directions = np.linalg.svd(weighed.steps[None])[2][1:].T
    moved = effect @ directions
    current = max(1.0, weight)
    while True:
        close = _CONVERGED if current <= weight else _ROUGH
        change = _newton(effect, error, current, change, moved, directions, close)
        if current <= weight:
            return change
        current = max(current / 100.0, weight)


def _newton(
    effect: np.ndarray,
    error: np.ndarray,
    weight: float,
    change: np.ndarray,
    moved: np.ndarray,
    directions: np.ndarray,
    close: float,
) -> np.ndarray:
    """Newton's method from a possible `change`, until the decrement is below `close`.

    Args:
        effect: (r, 10 B).
        error: (r,).
        weight: of the divergence.
        change: (10 B,) to begin with.
        moved: (r, m), effect @ directions.
        directions: (10 B, m) orthonormal, in which the change may go.
        close: least Newton decrement, relative to the square root of the weight.

    Returns:
        (10 B,).
    """

    def value(x: np.ndarray) -> float:
        left = effect @ x - error
        return float(left @ left / 2 + weight * divergence(relative_inertia(x)).sum())

    share, now = np.sqrt(weight), value(change)
    for _ in range(_MAX_STEPS):
        # To second order D is |K dx + w|^2 / 2, with Z = C C^T, K the change in the coordinates of
        # C^-1 dZ C^-T, and w those of C^T C - 1.
        root = np.linalg.cholesky(relative_inertia(change))
        inverse = np.linalg.inv(root)[:, None]
        metric = _block_diagonal(_coordinates(inverse @ BASIS @ inverse.mT).mT) @ directions
        slope = _coordinates(root.mT @ root - np.eye(4)).ravel()
        step, *_ = np.linalg.lstsq(
            np.concatenate([moved, share * metric]),
            np.concatenate([error - effect @ change, -share * slope]),
            rcond=None,
        )
        decrement = np.hypot(np.linalg.norm(moved @ step) / share, np.linalg.norm(metric @ step))
        length, move = 1.0, directions @ step
        while (then := value(change + length * move)) > now and length > _SHORTEST:
            length /= 2.0
        if then > now:  # rounding is all that is left to gain
            break
        change, now = change + length * move, then
        if decrement < close:
            break
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
