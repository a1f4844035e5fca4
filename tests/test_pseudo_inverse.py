"""The compiled pseudo-inverse against NumPy's, on matrices of all ranks."""

import numpy as np
import pytest

from fbid_gym.small_matrices import pseudo_inverse


def gram(rng: np.random.Generator, count: int, size: int, rank: int) -> np.ndarray:
    """(count, size, size) positive semidefinite matrices of a rank."""
    factor = rng.normal(size=(count, size, rank))
    return factor @ factor.mT


def inverted(matrix: np.ndarray, rtol: float = 1e-10) -> tuple[np.ndarray, np.ndarray]:
    """The inverses (N, k, k) and ranks (N,) of matrices (N, k, k)."""
    inverse = np.empty(matrix.shape)
    found = [pseudo_inverse(own, rtol, inverse[i]) for i, own in enumerate(matrix.copy())]
    return inverse, np.array(found)


def mixed(rng: np.random.Generator) -> np.ndarray:
    """Full rank, deficient, duplicated rows, zero rows, and all zero, side by side."""
    full, low = gram(rng, 1, 6, 9), gram(rng, 1, 6, 3)
    twice = np.kron(np.ones((2, 2)), gram(rng, 1, 3, 5)[0])[None]
    holes = gram(rng, 1, 6, 9)
    holes[:, [1, 4]] = 0.0
    holes[:, :, [1, 4]] = 0.0
    both = twice.copy()
    both[:, 2] = both[:, :, 2] = 0.0
    return np.concatenate([full, low, twice, holes, both, np.zeros((1, 6, 6))])


def test_pinv_equals_numpys(rng: np.random.Generator) -> None:
    matrix = mixed(rng)
    inverse, rank = inverted(matrix)
    expected = np.linalg.pinv(matrix, rcond=1e-10, hermitian=True)
    np.testing.assert_allclose(inverse, expected, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_array_equal(rank, [6, 3, 3, 4, 3, 0])


@pytest.mark.parametrize("size", [1, 6, 12, 24])
@pytest.mark.parametrize("missing", [0, 1, 5])
def test_pinv_satisfies_penroses_conditions(
    rng: np.random.Generator, size: int, missing: int
) -> None:
    rank = max(size - missing, 0)
    matrix = gram(rng, 5, size, rank)
    inverse, found = inverted(matrix)
    np.testing.assert_array_equal(found, rank)
    scale = np.abs(matrix).max()
    np.testing.assert_allclose(matrix @ inverse @ matrix, matrix, atol=1e-8 * scale)
    np.testing.assert_allclose(
        inverse @ matrix @ inverse, inverse, atol=1e-8 * np.abs(inverse).max()
    )
    np.testing.assert_allclose(matrix @ inverse, (matrix @ inverse).mT, atol=1e-7)


def test_rank_follows_the_tolerance() -> None:
    matrix = np.diag([1.0, 1e-4, 1e-8])[None]
    for rtol, rank in ((1e-10, 3), (1e-6, 2), (1e-2, 1)):
        inverse, found = inverted(matrix, rtol)
        assert found[0] == rank
        np.testing.assert_allclose(
            inverse[0], np.diag([1.0, 1e4, 1e8] * (np.arange(3) < rank)), rtol=1e-7
        )


def test_small_and_large_units_do_not_matter(rng: np.random.Generator) -> None:
    matrix = mixed(rng)
    inverse, rank = inverted(matrix)
    for unit in (1e-9, 1e9):
        scaled, scaled_rank = inverted(unit * matrix)
        np.testing.assert_array_equal(scaled_rank, rank)
        np.testing.assert_allclose(unit * scaled, inverse, atol=1e-6 * np.abs(inverse).max())


def test_empty_matrices_have_rank_zero() -> None:
    inverse, rank = inverted(np.zeros((3, 0, 0)))
    assert inverse.shape == (3, 0, 0)
    np.testing.assert_array_equal(rank, 0)
