"""Check the equations of motion that the laws start from."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from fbid_gym.checks import check_shape, contiguous, positive_numbers, real_numbers
from fbid_gym.compiled import compiled
from fbid_gym.errors import InvalidValueError, ShapeError
from fbid_gym.quantities import Constraint, EquationOfMotion

Arrays = TypeVar("Arrays", bound=Any)

# Mobilities of the base beside one of the joints. Farther from it they would hardly change what
# moves, but contacts that joints alone, or the base alone, can serve would be lost in rounding.
_LEAST_MOBILITY, _MOST_MOBILITY = 1e-6, 1e6


def fitted(
    name: str,
    array: np.ndarray | None,
    axes: str,
    sizes: Mapping[str, int],
    default: np.ndarray | None = None,
) -> np.ndarray:
    """Return an array as compiled code takes it, see `contiguous`.

    Args:
        name: what errors call it.
        array: of any layout; None for the default.
        axes: its axes by name or by size, as "(N, 6, nv)".
        sizes: of the axes that have a name.
        default: what stands for None, of whatever shape.

    Raises:
        ShapeError: it has another shape.
    """
    if array is None and default is not None:
        return default
    words = filter(None, axes.strip("()").replace(", ", ",").split(","))
    array = np.asarray(array)
    check_shape(name, array, tuple(sizes[x] if x in sizes else int(x) for x in words), axes)
    return contiguous(array)


def fitted_all(
    prefix: str, arrays: Arrays, axes: Sequence[str], sizes: Mapping[str, int]
) -> Arrays:
    """Return a named tuple of arrays, each `fitted`; errors call them by prefix and field."""
    rows = zip(arrays._fields, arrays, axes, strict=True)
    return type(arrays)(*(fitted(prefix + name, array, own, sizes) for name, array, own in rows))


def contact_sizes(jacobian: np.ndarray) -> dict[str, int]:
    """Return the sizes N, k, nv and n that the contacts' Jacobian (N, k, nv) says.

    Raises:
        ShapeError: it has other axes, or none for the joints.
    """
    shape = tuple(jacobian.shape)
    if len(shape) != 3 or shape[2] < 6:
        raise ShapeError("jacobian", shape, "(N, k, nv) with nv of at least 6")
    return {"N": shape[0], "k": shape[1], "nv": shape[2], "n": shape[2] - 6}


def checked_equations(
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    jacobian: np.ndarray,
    jacobian_bias: np.ndarray,
    drift: str = "jacobian_bias",
) -> tuple[EquationOfMotion, Constraint, dict[str, int]]:
    """Return equation of motion, constraint of the contacts, and sizes; `drift` is Jdot v's name.

    Raises:
        ShapeError: an array does not fit the Jacobian.
    """
    sizes = contact_sizes(jacobian)
    motion = EquationOfMotion(
        fitted("mass_matrix", mass_matrix, "(N, nv, nv)", sizes),
        fitted("bias", bias, "(N, nv)", sizes),
    )
    own = fitted(drift, jacobian_bias, "(N, k)", sizes)
    return motion, Constraint(contiguous(jacobian), own), sizes


def numbers_of_robots(name: str, given: float | np.ndarray, count: int) -> np.ndarray:
    """Return positive numbers of N robots, (N,); one number stands for all.

    NaN passes: it belongs to a robot gone wrong, which harms no other.

    Raises:
        ShapeError: there are neither one nor N.
        InvalidValueError: one is not positive.
    """
    expected = "positive numbers, one or (N,)"
    numbers = np.atleast_1d(real_numbers(name, given, expected))
    if numbers.shape == (1,):
        numbers = np.broadcast_to(numbers, (count,))
    numbers = fitted(name, numbers, "(N,)", {"N": count})
    if (numbers <= 0.0).any():
        raise InvalidValueError(name, given, expected)
    return numbers


def mobility_of(velocities: int, base_priority: Any) -> np.ndarray:
    """Return how readily coordinates depart from their desired acceleration: (nv,), 1 for joints.

    For the base that is one over `base_priority`, one or six weights of its squared accelerations.

    Raises:
        InvalidValueError: `base_priority` is not positive and finite.
    """
    mobility = np.ones(velocities)
    mobility[:6] /= positive_numbers("base_priority", base_priority, 1, 6)
    return mobility


@compiled
def bound_mobility(mobility: np.ndarray, arm: float, bounded: np.ndarray) -> tuple[float, float]:
    """Write the base's six mobilities to `bounded`, as far from the joints', one, as makes sense.

    Returned are the least and the greatest of them, those of shifts as multiples of `arm`^2: at
    this arm (m) shifts count as turns do.
    """
    least, most = np.inf, 0.0
    for i in range(6):
        unit = arm**2 if i < 3 else 1.0
        bounded[i] = min(max(mobility[i], _LEAST_MOBILITY * unit), _MOST_MOBILITY * unit)
        least, most = min(least, bounded[i] / unit), max(most, bounded[i] / unit)
    return least, most


@compiled
def radius_of_gyration(mass_matrix: np.ndarray) -> float:
    """Of a robot with locked joints about its base, m; from M (nv, nv)."""
    mass, inertia = 0.0, 0.0
    for axis in range(3):
        mass += mass_matrix[axis, axis]
        inertia += mass_matrix[3 + axis, 3 + axis]
    return np.sqrt(inertia / mass)
