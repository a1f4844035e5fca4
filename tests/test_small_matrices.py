"""Compiled linear algebra against NumPy's, on all sizes a robot has, none included."""

import numpy as np
import pytest

from fbid_gym import small_matrices as small

SIZES = (0, 1, 3, 12, 33)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.mark.parametrize("inner", SIZES)
@pytest.mark.parametrize("rows", SIZES)
def test_products(rng: np.random.Generator, rows: int, inner: int) -> None:
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
def test_factors(rng: np.random.Generator, size: int) -> None:
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


def test_what_cannot_be_factored_is_nan_and_raises_nothing() -> None:
    for matrix in (-np.eye(3), np.full((3, 3), np.nan), np.full((3, 3), np.inf)):
        small.factor(matrix)
        vector = np.ones(3)
        small.solve_factored(matrix, vector)
        assert np.isnan(vector).all()


@pytest.mark.parametrize("size", SIZES[1:])
@pytest.mark.parametrize("lost", [0, 1, 2])
def test_pseudo_inverse(rng: np.random.Generator, size: int, lost: int) -> None:
    rank = max(size - lost, 0)
    root = rng.normal(size=(size, rank))
    matrix, inverse = root @ root.T, np.empty((size, size))
    expected = np.linalg.pinv(matrix, rcond=1e-10, hermitian=True)
    assert small.pseudo_inverse(np.tril(matrix), 1e-10, inverse) == rank
    np.testing.assert_allclose(inverse, expected, rtol=1e-6, atol=1e-8)
    matrix[0, 0] = np.nan
    assert small.pseudo_inverse(matrix, 1e-10, inverse) == 0
    assert np.isnan(inverse).all()


@pytest.mark.parametrize(("size", "lost"), [(1, 0), (6, 0), (6, 1), (6, 3), (9, 2), (6, 6)])
def test_rank(rng: np.random.Generator, size: int, lost: int) -> None:
    for _ in range(20):
        basis, _ = np.linalg.qr(rng.normal(size=(size, size)))
        values = np.append(rng.uniform(0.01, 1.0, size - lost), np.zeros(lost))
        matrix = (basis * values) @ basis.T
        assert small.rank_of(np.tril(matrix), 1e-8) == (0 if lost == size else size - lost)
    matrix[0, -1] = matrix[-1, 0] = np.nan
    assert small.rank_of(matrix, 1e-8) == 0


@pytest.mark.parametrize("size", SIZES[1:])
def test_factor_damped(rng: np.random.Generator, size: int) -> None:
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
