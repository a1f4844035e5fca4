"""Pseudo-inverse of batches of small symmetric matrices, as fast as an inverse where one exists."""

from typing import NamedTuple

import numpy as np

from fbid_gym.checks import contiguous
from fbid_gym.compiled import kernel
from fbid_gym.errors import ShapeError
from fbid_gym.small_matrices import copy, pseudo_inverse


class PseudoInverse(NamedTuple):
    """Moore-Penrose inverses.

    Attributes:
        inverse: (N, k, k).
        rank: (N,) int64.
    """

    inverse: np.ndarray
    rank: np.ndarray


def symmetric_pseudo_inverse(matrix: np.ndarray, rtol: float = 1e-10) -> PseudoInverse:
    """Moore-Penrose inverse and rank of symmetric positive semidefinite matrices.

    A matrix's result does not depend on the others in the batch.

    Args:
        matrix: (N, k, k), symmetric positive semidefinite. k may be 0.
        rtol: eigenvalues at or below `rtol` times the largest count as zero.

    Returns:
        Of a matrix that holds NaN or infinity: NaN and rank 0.

    Raises:
        ShapeError: the input is not a batch of square matrices.
    """
    shape = tuple(matrix.shape)
    if len(shape) != 3 or shape[1] != shape[2]:
        raise ShapeError("matrix", shape, "a batch of square matrices (N, k, k)")
    return _invert_all(contiguous(matrix), rtol)


@kernel
def _invert_all(matrix: np.ndarray, rtol: float) -> PseudoInverse:
    """`pseudo_inverse` of every robot's matrix."""
    count, size, _ = matrix.shape
    inverse, rank = np.empty(matrix.shape), np.empty(count, np.int64)
    own = np.empty((size, size))
    for i in range(count):
        for row in range(size):
            copy(matrix[i, row], own[row])
        rank[i] = pseudo_inverse(own, rtol, inverse[i])
    return PseudoInverse(inverse, rank)
