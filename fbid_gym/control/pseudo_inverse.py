"""Pseudo-inverse of batches of small symmetric matrices, as fast as an inverse where one exists."""

import numpy as np

from fbid_gym.control.arrays import Array, identity, namespace
from fbid_gym.errors import ShapeError

_NEARLY_SINGULAR = 1e-13


def symmetric_pseudo_inverse(matrix: Array, rtol: float = 1e-10) -> tuple[Array, Array]:
    """Moore-Penrose inverse and rank of symmetric positive semidefinite matrices.

    Contact Gram matrices are usually invertible, and an eigendecomposition costs several inverses.
    So all matrices are inverted, each is certified by the bound |A|_F |A^-1|_F < 1 / rtol on its
    condition number, and only those that fail are decomposed and truncated. A zero row (a contact
    that is absent) is no failure: such rows are left out and stay zero.

    A matrix's result does not depend on the others in the batch.

    Args:
        matrix: (N, k, k), symmetric positive semidefinite. k may be 0.
        rtol: eigenvalues at or below `rtol` times the largest count as zero.

    Returns:
        Pseudo-inverse (N, k, k) and rank (N,), integers. A matrix that holds NaN or infinity gets
        NaN and rank 0.

    Raises:
        ShapeError: the input is not a batch of square matrices.
    """
    shape = tuple(matrix.shape)
    if len(shape) != 3 or shape[1] != shape[2]:
        raise ShapeError("matrix", shape, "a batch of square matrices (N, k, k)")
    xp = namespace(matrix)
    count, size, _ = shape
    flat = matrix.reshape(count, size * size)
    diagonal = flat[:, :: size + 1]
    if diagonal.all():
        inverse = _inverse(matrix)
        rank = xp.full((count,), size, dtype=xp.int64, device=matrix.device)
    else:
        absent = diagonal == 0.0
        fill = xp.astype(absent, matrix.dtype)[:, :, None] * identity(size, matrix)
        inverse = _inverse(matrix + fill) - fill
        rank = size - xp.sum(xp.astype(absent, xp.int64), axis=-1)

    flat_inverse = inverse.reshape(count, size * size)
    bound = xp.vecdot(flat, flat) * xp.vecdot(flat_inverse, flat_inverse)
    certified = bound < rtol**-2
    if not certified.all():
        doubtful = xp.nonzero(~certified)[0]
        inverse[doubtful], rank[doubtful] = _truncated(matrix[doubtful], rtol)
    return inverse, rank


def _inverse(matrix: Array) -> Array:
    """Inverses; NaN for matrices that are exactly singular or not finite."""
    xp = namespace(matrix)
    try:
        return xp.linalg.inv(matrix)
    except (np.linalg.LinAlgError, RuntimeError):
        # One zero pivot fails the whole batch. Those near one are left to the eigendecomposition.
        stand_in = identity(matrix.shape[-1], matrix)
        usable = xp.all(xp.isfinite(matrix), axis=(-2, -1))[:, None, None]
        values = xp.linalg.eigvalsh(xp.where(usable, matrix, stand_in))
        usable = usable & (values[:, :1] > _NEARLY_SINGULAR * values[:, -1:])[:, None]
        return xp.where(usable, xp.linalg.inv(xp.where(usable, matrix, stand_in)), xp.nan)


def _truncated(matrix: Array, rtol: float) -> tuple[Array, Array]:
    """Pseudo-inverse and rank by eigendecomposition."""
    xp = namespace(matrix)
    finite = xp.all(xp.isfinite(matrix), axis=(-2, -1))
    values, vectors = xp.linalg.eigh(xp.where(finite[:, None, None], matrix, 0.0))
    keep = values > rtol * values[:, -1:]
    scale = xp.where(keep, 1.0 / xp.where(keep, values, 1.0), 0.0)
    inverse = (vectors * scale[:, None, :]) @ vectors.mT
    rank = xp.sum(xp.astype(keep, xp.int64), axis=-1)
    return xp.where(finite[:, None, None], inverse, xp.nan), rank
