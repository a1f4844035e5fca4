"""The pseudo-inverse against NumPy's, and its independence of neighbours."""

import numpy as np
import pytest

from fbid_gym.control import symmetric_pseudo_inverse
from fbid_gym.errors import ShapeError


def gram(rng: np.random.Generator, count: int, size: int, rank: int) -> np.ndarray:
    """(count, size, size) positive semidefinite matrices of a rank."""
    factor = rng.normal(size=(count, size, rank))
    return factor @ factor.mT


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
    inverse, rank = symmetric_pseudo_inverse(matrix)
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
    inverse, found = symmetric_pseudo_inverse(matrix)
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
        inverse, found = symmetric_pseudo_inverse(matrix, rtol)
        assert found[0] == rank
        np.testing.assert_allclose(
            inverse[0], np.diag([1.0, 1e4, 1e8] * (np.arange(3) < rank)), rtol=1e-7
        )


def test_small_and_large_units_do_not_matter(rng: np.random.Generator) -> None:
    matrix = mixed(rng)
    inverse, rank = symmetric_pseudo_inverse(matrix)
    for unit in (1e-9, 1e9):
        scaled, scaled_rank = symmetric_pseudo_inverse(unit * matrix)
        np.testing.assert_array_equal(scaled_rank, rank)
        np.testing.assert_allclose(unit * scaled, inverse, atol=1e-6 * np.abs(inverse).max())


def test_neighbours_change_no_bit(rng: np.random.Generator) -> None:
    matrix = mixed(rng)
    # All ones is singular without rounding: plain inversion would refuse the whole batch.
    matrix = np.concatenate([matrix, np.ones((1, 6, 6)), np.full((1, 6, 6), np.nan)])
    inverse, rank = symmetric_pseudo_inverse(matrix)
    for i in range(len(matrix)):
        alone, alone_rank = symmetric_pseudo_inverse(matrix[i : i + 1])
        np.testing.assert_array_equal(alone[0], inverse[i])
        assert alone_rank[0] == rank[i]


def test_nan_stays_where_it_is(rng: np.random.Generator) -> None:
    matrix = mixed(rng)
    matrix[2, 3, 3] = np.nan
    inverse, rank = symmetric_pseudo_inverse(matrix)
    assert np.isnan(inverse[2]).all()
    assert rank[2] == 0
    assert np.isfinite(np.delete(inverse, 2, axis=0)).all()


def test_empty_matrices_have_rank_zero() -> None:
    inverse, rank = symmetric_pseudo_inverse(np.zeros((3, 0, 0)))
    assert inverse.shape == (3, 0, 0)
    np.testing.assert_array_equal(rank, 0)


@pytest.mark.parametrize("shape", [(3, 3), (2, 3, 4), (1, 2, 3, 3)])
def test_pinv_names_a_wrong_shape(shape: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError, match=r"matrix has shape .* batch of square matrices"):
        symmetric_pseudo_inverse(np.ones(shape))
