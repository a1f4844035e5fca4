"""What the control laws need around the array-API standard, kept cheap for a batch of one.

The papers' equations run on NumPy and on torch through `array_api_compat`. Looking a namespace up
or building a small constant costs as much as a batched product of small matrices, so both are
cached here. Compiled laws take their arrays on the host and give them back where they came from.
"""

from functools import lru_cache
from types import ModuleType
from typing import Any, TypeVar

import array_api_compat
import numpy as np

from fbid_gym.errors import ShapeError

# NumPy array or torch tensor, floating point, batch axis first.
Array = Any

Parts = TypeVar("Parts", bound=tuple[Any, ...])

_namespaces: dict[type, ModuleType] = {}


def namespace(array: Array) -> ModuleType:
    """Array-API namespace of an array, looked up once per array type."""
    try:
        return _namespaces[type(array)]
    except KeyError:
        found = _namespaces[type(array)] = array_api_compat.array_namespace(array)
        return found


@lru_cache(maxsize=256)
def _identity(xp: ModuleType, size: int, scale: float, dtype: Any, device: Any) -> Array:
    return scale * xp.eye(size, dtype=dtype, device=device)


def identity(size: int, like: Array, scale: float = 1.0) -> Array:
    """A cached (size, size) multiple of the identity, of `like`'s type; never write to it."""
    return _identity(namespace(like), size, scale, like.dtype, like.device)


def matvec(matrix: Array, vector: Array) -> Array:
    """Batched matrix-vector product: (N, a, b) times (N, b) gives (N, a)."""
    return (matrix @ vector[..., None])[..., 0]


def as_numpy(array: Array) -> np.ndarray:
    """The array in float64 on the host, contiguous; itself if it is that already."""
    if not isinstance(array, np.ndarray):
        array = array_api_compat.to_device(array.detach(), "cpu").numpy()
    return np.ascontiguousarray(array, np.float64)


def on_host(parts: Parts) -> Parts:
    """A named tuple of arrays, each by `as_numpy`; itself if it holds NumPy arrays already."""
    if isinstance(parts[0], np.ndarray):
        return parts
    return type(parts)(*map(as_numpy, parts))


def as_flags(array: Array) -> np.ndarray:
    """A mask as booleans on the host, contiguous; itself if it is that already."""
    if not isinstance(array, np.ndarray):
        array = array_api_compat.to_device(array, "cpu").numpy()
    return np.ascontiguousarray(array, np.bool_)


def from_numpy(array: np.ndarray, like: Array) -> Array:
    """The array on `like`'s device and, unless it holds integers, of its type."""
    if isinstance(like, np.ndarray):
        return array.astype(like.dtype, copy=False) if array.dtype.kind == "f" else array
    xp = namespace(like)
    return xp.asarray(
        array, dtype=like.dtype if array.dtype.kind == "f" else None, device=like.device
    )


def check_shape(name: str, array: Array, expected: tuple[int, ...], axes: str) -> None:
    """Raise ShapeError unless `array` has the expected shape; `axes` names them, as "(N, nv)"."""
    if tuple(array.shape) != expected:
        raise ShapeError(name, tuple(array.shape), f"{axes} = {expected}")


def check_dynamics(
    mass_matrix: Array, bias: Array, jacobian: Array, acceleration: Array, jacobian_bias: Array
) -> tuple[int, int, int]:
    """Raise ShapeError unless the arrays every law starts with fit; return N, k and nv."""
    shape = tuple(jacobian.shape)
    if len(shape) != 3 or shape[2] < 6:
        raise ShapeError("jacobian", shape, "(N, k, nv) with nv of at least 6")
    count, rows, velocities = shape
    check_shape("mass_matrix", mass_matrix, (count, velocities, velocities), "(N, nv, nv)")
    check_shape("bias", bias, (count, velocities), "(N, nv)")
    check_shape("acceleration", acceleration, (count, velocities), "(N, nv)")
    check_shape("jacobian_bias", jacobian_bias, (count, rows), "(N, k)")
    return count, rows, velocities
