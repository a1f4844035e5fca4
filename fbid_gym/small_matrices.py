"""Linear algebra of one robot, compiled: matrices of a few dozen rows, without calls and checks.

LAPACK is made for larger ones, and refuses a matrix that is not finite together with its whole
batch. Results are written to the last argument. Innermost loops run along rows of memory.
"""

import numpy as np

from fbid_gym.compiled import compiled

# What sums over a few dozen products may get wrong of a matrix, as a share of its size.
_ROUNDING = 1e-13


@compiled
def multiply(left: np.ndarray, right: np.ndarray, result: np.ndarray) -> None:
    """Write to result (a, c): left (a, b) right (b, c)."""
    inner, columns = right.shape
    for i in range(left.shape[0]):
        row = result[i]
        row[:] = 0.0
        # Four rows at a time, so that the result is not read and written for each of them.
        done = inner - inner % 4
        for k in range(0, done, 4):
            a, b, c, d = left[i, k], left[i, k + 1], left[i, k + 2], left[i, k + 3]
            for j in range(columns):
                row[j] += (
                    a * right[k, j]
                    + b * right[k + 1, j]
                    + c * right[k + 2, j]
                    + d * right[k + 3, j]
                )
        for k in range(done, inner):
            a = left[i, k]
            for j in range(columns):
                row[j] += a * right[k, j]


@compiled
def multiply_transposed(left: np.ndarray, right: np.ndarray, result: np.ndarray) -> None:
    """Write to result (a, c): left^T right, with left (b, a), right (b, c)."""
    result[:] = 0.0
    for k in range(left.shape[0]):
        for i in range(left.shape[1]):
            factor = left[k, i]
            for j in range(right.shape[1]):
                result[i, j] += factor * right[k, j]


@compiled
def multiply_by_transpose(left: np.ndarray, right: np.ndarray, result: np.ndarray) -> None:
    """Write to result (a, c): left (a, b) right^T, with right (c, b)."""
    for i in range(left.shape[0]):
        for j in range(right.shape[0]):
            result[i, j] = dot(left[i], right[j])


@compiled
def gram(left: np.ndarray, right: np.ndarray, ridge: float, result: np.ndarray) -> None:
    """Lower half of result (a, a) = left right^T + ridge, known to be symmetric."""
    for i in range(left.shape[0]):
        for j in range(i + 1):
            result[i, j] = dot(left[i], right[j])
        result[i, i] += ridge


@compiled
def times(matrix: np.ndarray, vector: np.ndarray, result: np.ndarray) -> None:
    """Write to result (a,): matrix (a, b) vector (b,)."""
    for i in range(matrix.shape[0]):
        result[i] = dot(matrix[i], vector)


@compiled
def add_transposed_times(matrix: np.ndarray, vector: np.ndarray, result: np.ndarray) -> None:
    """Add to result (b,) the product matrix^T vector, with matrix (a, b), vector (a,)."""
    for i in range(matrix.shape[0]):
        factor = vector[i]
        for j in range(matrix.shape[1]):
            result[j] += factor * matrix[i, j]


@compiled
def copy(source: np.ndarray, target: np.ndarray) -> None:
    """Write one vector to another: `target[:] = source` takes the compiler seconds."""
    for i in range(len(source)):
        target[i] = source[i]


@compiled
def dot(a: np.ndarray, b: np.ndarray) -> float:
    """The inner product."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@compiled
def factor(matrix: np.ndarray) -> None:
    """Overwrite the lower half of a symmetric positive definite matrix with factors L D L^T of it.

    L has ones on its diagonal, where D^-1 is kept: no square roots, and no divisions when it comes
    to solve. Of a matrix that is not positive definite, NaN. Only the lower half is read.
    """
    size = len(matrix)
    if size == 6:  # loops whose length the compiler knows are twice as fast
        _factor(matrix, 6)
    elif size == 3:
        _factor(matrix, 3)
    else:
        _factor(matrix, size)


@compiled
def _factor(matrix: np.ndarray, size: int) -> None:
    for j in range(size):
        inverse = 1.0 / matrix[j, j] if matrix[j, j] > 0.0 else np.nan
        matrix[j, j] = inverse
        for i in range(j + 1, size):
            share = matrix[i, j] * inverse
            for k in range(j + 1, i + 1):
                matrix[i, k] -= share * matrix[k, j]
        for i in range(j + 1, size):
            matrix[i, j] *= inverse


@compiled
def lift(matrix: np.ndarray, ridge: float) -> None:
    """Raise a diagonal that holds a ridge already to where rounding leaves the matrix definite.

    Args:
        matrix: symmetric positive semidefinite plus `ridge`; nothing happens to one of common size.
        ridge: what its least eigenvalue is, but for rounding.
    """
    trace = 0.0
    for i in range(len(matrix)):
        trace += matrix[i, i]
    if ridge < _ROUNDING * trace:
        for i in range(len(matrix)):
            matrix[i, i] += _ROUNDING * trace - ridge


@compiled
def solve_factored(factors: np.ndarray, vector: np.ndarray) -> None:
    """Overwrite a vector (a,) with the solution of A x = vector; `factors` are those of A."""
    size = len(vector)
    if size == 6:
        _solve_factored(factors, vector, 6)
    elif size == 3:
        _solve_factored(factors, vector, 3)
    else:
        _solve_factored(factors, vector, size)


@compiled
def _solve_factored(factors: np.ndarray, vector: np.ndarray, size: int) -> None:
    for i in range(size):
        total = vector[i]
        for j in range(i):
            total -= factors[i, j] * vector[j]
        vector[i] = total
    for i in range(size):
        vector[i] *= factors[i, i]
    for i in range(size - 1, -1, -1):
        solved = vector[i]
        for j in range(i):
            vector[j] -= solved * factors[i, j]


@compiled
def solve_factored_columns(factors: np.ndarray, columns: np.ndarray) -> None:
    """Overwrite columns (a, m) with the solutions of A X = columns; `factors` are those of A."""
    size, count = columns.shape
    for i in range(size):
        for k in range(i):
            share = factors[i, k]
            for j in range(count):
                columns[i, j] -= share * columns[k, j]
    for i in range(size):
        for j in range(count):
            columns[i, j] *= factors[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i):
            share = factors[i, k]
            for j in range(count):
                columns[k, j] -= share * columns[i, j]


@compiled
def trace_of_inverse(factors: np.ndarray, column: np.ndarray) -> float:
    """Return the trace of A^-1 from the factors of A (a, a); `column` (a,) is a buffer."""
    # Of L^-T D^-1 L^-1, column by column of L^-1.
    trace, size = 0.0, len(factors)
    for j in range(size):
        for i in range(j, size):
            total = 1.0 if i == j else 0.0
            for k in range(j, i):
                total -= factors[i, k] * column[k]
            column[i] = total
            trace += total * total * factors[i, i]
    return trace


@compiled
def rank_of(matrix: np.ndarray, rtol: float) -> int:
    """Return the rank of a symmetric positive semidefinite matrix, whose lower half is overwritten.

    By Cholesky's method, always with the largest diagonal entry that is left; one at or below
    `rtol` times the first counts as zero. Zero for a matrix that is not finite.
    """
    size, first = len(matrix), 0.0
    for step in range(size):
        best = step
        for i in range(step, size):
            if not np.isfinite(matrix[i, i]):
                return 0
            if matrix[i, i] > matrix[best, best]:
                best = i
        pivot = matrix[best, best]
        if step == 0:
            first = pivot
        if not pivot > rtol * first:
            return step
        # Rows and columns change places, in the lower half.
        matrix[best, best] = matrix[step, step]
        for k in range(step + 1, best):
            matrix[k, step], matrix[best, k] = matrix[best, k], matrix[k, step]
        for k in range(best + 1, size):
            matrix[k, step], matrix[k, best] = matrix[k, best], matrix[k, step]
        for i in range(step + 1, size):
            share = matrix[i, step] / pivot
            for k in range(step + 1, i + 1):
                matrix[i, k] -= share * matrix[k, step]
    return size


@compiled
def invert(matrix: np.ndarray, inverse: np.ndarray) -> tuple[int, float]:
    """Write the inverse (a, a) of a symmetric positive definite matrix, rows of zeros left out.

    The lower half is read, the upper one is filled.

    Returns:
        The number of rows that are not zero, and a bound on their condition number: no number below
        infinity where they are not positive definite, and then the inverse is none.
    """
    rows, lower = len(matrix), np.empty_like(matrix)
    size, inverse_size, rank = 0.0, 0.0, 0
    for i in range(rows):
        for j in range(rows):
            matrix[i, j] = matrix[max(i, j), min(i, j)]
            lower[i, j] = matrix[i, j]
            inverse[i, j] = 1.0 if i == j else 0.0
        if matrix[i, i] == 0.0:
            lower[i, i] = 1.0
        else:
            rank += 1
    factor(lower)
    solve_factored_columns(lower, inverse)
    for i in range(rows):
        if matrix[i, i] == 0.0:
            inverse[i, i] -= 1.0
        size += dot(matrix[i], matrix[i])
        inverse_size += dot(inverse[i], inverse[i])
    return rank, np.sqrt(size * inverse_size)  # |A| |A^-1|


@compiled
def pseudo_inverse(matrix: np.ndarray, rtol: float, inverse: np.ndarray) -> int:
    """Write the inverse (a, a) of a symmetric positive semidefinite matrix; returns its rank.

    Eigenvalues at or below `rtol` times the largest count as zero. The lower half is read, the
    upper one is filled. A matrix that is not finite gets NaN and rank 0.

    Most matrices are regular but for rows of zeros: they are inverted without those, and certified
    by a bound on the condition number. Only those that fail are decomposed.
    """
    rank, condition = invert(matrix, inverse)
    if condition < 1.0 / rtol:
        return rank
    if not np.isfinite(matrix.sum()):
        inverse[:] = np.nan
        return 0
    values, vectors = np.linalg.eigh(matrix)
    inverse[:] = 0.0
    rank, rows = 0, len(matrix)
    for k in range(rows):
        if values[k] > rtol * values[-1]:
            rank += 1
            for i in range(rows):
                for j in range(rows):
                    inverse[i, j] += vectors[i, k] * vectors[j, k] / values[k]
    return rank


@compiled
def factor_damped(matrix: np.ndarray, least: float) -> None:
    """Overwrite the lower half of a symmetric positive semidefinite matrix with its factors.

    Of the matrix itself if no eigenvalue is below `least`. Otherwise those below, x, become x + d,
    d / least = (1 - x / least)^2: what is solved with it is continuous with its derivative, and
    nowhere more than 1.34 / least of what it is solved for. Only the lower half is read. Rounding
    takes part in it: `least` is no less than what it makes of a matrix of this size.
    """
    size, given = len(matrix), matrix.copy()
    total = 0.0
    for i in range(size):
        total += matrix[i, i]
    least = max(least, _ROUNDING * total)
    factor(matrix)
    # It bounds the least eigenvalue.
    trace = trace_of_inverse(matrix, np.empty(size))
    if trace * least < 1.0:
        return
    for i in range(size):
        for j in range(i):
            given[j, i] = given[i, j]
    matrix[:] = np.nan
    # LAPACK takes finite matrices only.
    if np.isfinite(given).all():
        values, vectors = np.linalg.eigh(given)
        least = max(least, _ROUNDING * max(values[-1], -values[0]))
        values = np.maximum(values, 0.0)
        values += least * np.maximum(1.0 - values / least, 0.0) ** 2
        multiply_by_transpose(vectors * values, vectors, matrix)
        factor(matrix)
