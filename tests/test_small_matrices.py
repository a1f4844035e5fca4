"""Compiled linear algebra against NumPy's, on all sizes a robot has, none included."""

import numpy as np
import pytest

from fbid_gym import small_matrices as small
from tests.pairs import pairs

SIZES = (0, 1, 3, 12, 33)


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.mark.parametrize(("rows", "inner"), pairs(SIZES, SIZES))
def test_products(rng, rows, inner):
    left, right = rng.normal(size=(rows, inner)), rng.normal(size=(inner, 6))
    vector, result = rng.normal(size=inner), rng.normal(size=(rows, 6))
    small.multiply(left, right, result)
    np.testing.assert_allclose(result, left @ right, atol=1e-12)
    small.multiply_transposed(np.ascontiguousarray(left.T), right, result)
    np.testing.assert_allclose(result, left @ right, atol=1e-12)
    small.multiply_by_transpose(left, np.ascontiguousarray(right.T), result)
    np.testing.assert_allclose(result, left @ right, atol=1e-12)
    image = rng.normal(size=rows)
    small.times(left, vector, image)
    np.testing.assert_allclose(image, left @ vector, atol=1e-12)
    total = np.ones(inner)
    small.add_transposed_times(left, image, total)
    np.testing.assert_allclose(total, 1.0 + left.T @ image, atol=1e-12)
    assert small.dot(vector, vector) == pytest.approx(vector @ vector)


def product_of(factors: np.ndarray) -> np.ndarray:
    """L D L^T: D^-1 is on the diagonal, L below it."""
    left = np.tril(factors, -1) + np.eye(len(factors))
    return (left / np.diag(factors)) @ left.T


@pytest.mark.parametrize("size", SIZES)
def test_factors(rng, size):
    root, ridge = rng.normal(size=(size, size + 2)), 0.1
    lower = np.full((size, size), np.nan)
    small.gram(root, root, ridge, lower)
    matrix = root @ root.T + ridge * np.eye(size)
    np.testing.assert_allclose(np.tril(lower), np.tril(matrix), atol=1e-12)
    small.factor(lower)
    np.testing.assert_allclose(product_of(lower), matrix, atol=1e-12)
    trace = small.trace_of_inverse(lower, np.empty(size))
    assert trace == pytest.approx(np.trace(np.linalg.inv(matrix)))
    vector, columns = rng.normal(size=size), rng.normal(size=(size, 4))
    solution, solutions = vector.copy(), columns.copy()
    small.solve_factored(lower, solution)
    small.solve_factored_columns(lower, solutions)
    np.testing.assert_allclose(matrix @ solution, vector, atol=1e-10)
    np.testing.assert_allclose(matrix @ solutions, columns, atol=1e-10)


def test_what_cannot_be_factored_is_nan_and_raises_nothing():
    for matrix in (-np.eye(3), np.full((3, 3), np.nan), np.full((3, 3), np.inf)):
        small.factor(matrix)
        vector = np.ones(3)
        small.solve_factored(matrix, vector)
        assert np.isnan(vector).all()


def inverted(matrix: np.ndarray, rtol: float = 1e-10) -> tuple[np.ndarray, np.ndarray]:
    """The pseudo-inverses (N, k, k) and ranks (N,) of matrices (N, k, k)."""
    inverse = np.empty(matrix.shape)
    found = [small.pseudo_inverse(own, rtol, inverse[i]) for i, own in enumerate(matrix.copy())]
    return inverse, np.array(found)


def of_all_ranks(rng: np.random.Generator) -> np.ndarray:
    """(6, 6, 6): full rank, deficient, duplicated rows, zero rows, both, and all zero."""
    full, low, twice = (rng.normal(size=shape) for shape in ((6, 9), (6, 3), (3, 5)))
    twice = np.tile(twice, (2, 1))
    holes, both = full.copy(), twice.copy()
    holes[[1, 4]], both[2] = 0.0, 0.0
    return np.array([root @ root.T for root in (full, low, twice, holes, both, np.zeros((6, 1)))])


def test_pseudo_inverse_is_numpys_in_any_unit(rng):
    matrix = of_all_ranks(rng)
    expected = np.linalg.pinv(matrix, rcond=1e-10, hermitian=True)
    for unit in (1.0, 1e-9, 1e9):
        inverse, rank = inverted(unit * matrix)
        np.testing.assert_array_equal(rank, [6, 3, 3, 4, 3, 0])
        np.testing.assert_allclose(unit * inverse, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("size", [*SIZES, 24])
def test_pseudo_inverse_of_any_size_and_rank(rng, size):
    """Against NumPy, and by Penrose's conditions; of what is no number it is none."""
    for lost in (0, 1, 2, 5):
        root = rng.normal(size=(size, max(size - lost, 0)))
        matrix = root @ root.T
        (inverse,), (rank,) = inverted(matrix[None])
        assert rank == root.shape[1]
        expected = np.linalg.pinv(matrix, rcond=1e-10, hermitian=True)
        np.testing.assert_allclose(inverse, expected, rtol=1e-6, atol=1e-8)
        largest = [np.abs(values).max(initial=0.0) for values in (matrix, inverse)]
        np.testing.assert_allclose(matrix @ inverse @ matrix, matrix, atol=1e-8 * largest[0])
        np.testing.assert_allclose(inverse @ matrix @ inverse, inverse, atol=1e-8 * largest[1])
        np.testing.assert_allclose(matrix @ inverse, (matrix @ inverse).T, atol=1e-7)
        if size:
            matrix[0, 0] = np.nan
            (inverse,), (rank,) = inverted(matrix[None])
            assert rank == 0 and np.isnan(inverse).all()


def test_rank_follows_the_tolerance():
    matrix = np.diag([1.0, 1e-4, 1e-8])[None]
    for rtol, rank in ((1e-10, 3), (1e-6, 2), (1e-2, 1)):
        (inverse,), found = inverted(matrix, rtol)
        assert found == rank
        kept = np.diag([1.0, 1e4, 1e8] * (np.arange(3) < rank))
        np.testing.assert_allclose(inverse, kept, rtol=1e-7)


@pytest.mark.parametrize(("size", "lost"), [(1, 0), (6, 0), (6, 1), (6, 3), (9, 2), (6, 6)])
def test_rank(rng, size, lost):
    for _ in range(20):
        basis, _ = np.linalg.qr(rng.normal(size=(size, size)))
        values = np.append(rng.uniform(0.01, 1.0, size - lost), np.zeros(lost))
        matrix = (basis * values) @ basis.T
        assert small.rank_of(np.tril(matrix), 1e-8) == (0 if lost == size else size - lost)
    matrix[0, -1] = matrix[-1, 0] = np.nan
    assert small.rank_of(matrix, 1e-8) == 0


@pytest.mark.parametrize("size", SIZES[1:])
def test_factor_damped(rng, size):
    """Eigenvalues below the least are raised as promised, the others kept."""
    basis, _ = np.linalg.qr(rng.normal(size=(size, size)))
    for least in (1e-6, 0.01, 10.0):
        values = np.append(0.0, np.geomspace(1e-4, 1.0, size - 1)) if size > 1 else np.ones(1)
        for spectrum in (values, values + least):
            raised = spectrum + least * np.maximum(1.0 - spectrum / least, 0.0) ** 2
            matrix = np.tril((basis * spectrum) @ basis.T)
            small.factor_damped(matrix, least)
            np.testing.assert_allclose(product_of(matrix), (basis * raised) @ basis.T, atol=1e-12)
            assert (raised >= least / 1.34).all()
    matrix = np.full((size, size), np.nan)
    small.factor_damped(matrix, 0.1)
    assert np.isnan(matrix).all()
