"""Three numbers at a time, compiled: as tuples, which stay in the processor's registers.

To a kernel, a slice of an array costs as much as a dozen products.
"""

import numpy as np

from fbid_gym.compiled import compiled

Vector = tuple[float, float, float]
Rotation = tuple[Vector, Vector, Vector]
Six = tuple[Vector, Vector]
NOTHING = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
"""Six zeros."""


@compiled
def vector(array: np.ndarray, row: tuple[int, ...], first: int = 0) -> Vector:
    """Read array[*row, first : first + 3]."""
    return array[row + (first,)], array[row + (first + 1,)], array[row + (first + 2,)]


@compiled
def matrix(array: np.ndarray, row: tuple[int, ...]) -> Rotation:
    """Read array[*row], 3 × 3, row by row."""
    return vector(array, row + (0,)), vector(array, row + (1,)), vector(array, row + (2,))


@compiled
def store(a: Vector, array: np.ndarray, row: tuple[int, ...], first: int = 0) -> None:
    """Write to array[*row, first : first + 3]."""
    array[row + (first,)], array[row + (first + 1,)], array[row + (first + 2,)] = a


@compiled
def store_matrix(a: Rotation, array: np.ndarray, row: tuple[int, ...]) -> None:
    """Write to array[*row], 3 × 3, row by row."""
    store(a[0], array, row + (0,))
    store(a[1], array, row + (1,))
    store(a[2], array, row + (2,))


@compiled
def add(a: Vector, b: Vector) -> Vector:
    """The sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def subtract(a: Vector, b: Vector) -> Vector:
    """The difference."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def scale(factor: float, a: Vector) -> Vector:
    """The multiple."""
    return factor * a[0], factor * a[1], factor * a[2]


@compiled
def dot(a: Vector, b: Vector) -> float:
    """The inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: Vector, b: Vector) -> Vector:
    """The product a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def turn(rotation: Rotation, a: Vector) -> Vector:
    """Rotation times a, with the rows of the rotation."""
    return dot(rotation[0], a), dot(rotation[1], a), dot(rotation[2], a)


@compiled
def transposed(rows: Rotation) -> Rotation:
    """The rows of the transposed matrix."""
    return (
        (rows[0][0], rows[1][0], rows[2][0]),
        (rows[0][1], rows[1][1], rows[2][1]),
        (rows[0][2], rows[1][2], rows[2][2]),
    )


@compiled
def product(left: Rotation, right: Rotation) -> Rotation:
    """Left times right, row by row."""
    columns = transposed(right)
    return turn(columns, left[0]), turn(columns, left[1]), turn(columns, left[2])


@compiled
def six(array: np.ndarray, row: tuple[int, ...]) -> Six:
    """Read array[*row, :6]."""
    return vector(array, row), vector(array, row, 3)


@compiled
def add_share(a: Six, share: float, b: Six) -> Six:
    """The sum of six numbers and a multiple of six others."""
    return add(a[0], scale(share, b[0])), add(a[1], scale(share, b[1]))


@compiled
def store_six(a: Six, array: np.ndarray, row: tuple[int, ...]) -> None:
    """Write to array[*row, :6]."""
    store(a[0], array, row)
    store(a[1], array, row, 3)
