"""Arrays that compiled code is told of once: a table of where they lie in memory, and how large.

Compiled code that is handed the table finds the arrays in it, as they are by then. Whoever keeps
the table keeps the arrays.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import carray, types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable

_TYPES = {kind.__name__: kind for kind in (np.float64, np.int64, np.int32, np.bool)}

Form = tuple[str, int]
"""Of an array: the name of its type, and how many axes it has; 0 of a number."""


@dataclass(frozen=True, eq=False)
class Table:
    """A table, and what it tells of.

    Attributes:
        numbers: int64; of each array its address and its lengths.
        arrays: C-contiguous.
        forms: of each.
    """

    numbers: np.ndarray
    arrays: Sequence[np.ndarray]
    forms: tuple[Form, ...]

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> "Table":
        """Return the table of arrays and numbers by name."""
        arrays = [np.asarray(value) for value in values.values()]
        for name, array in zip(values, arrays, strict=True):
            if not array.flags.c_contiguous or array.dtype.name not in _TYPES:
                raise AssertionError(f"{name} is not C-contiguous, or of none of {[*_TYPES]}")
        numbers = [number for array in arrays for number in (array.ctypes.data, *array.shape)]
        forms = tuple((array.dtype.name, array.ndim) for array in arrays)
        return cls(np.array(numbers, np.int64), arrays, forms)


def found(forms: Sequence[Form], table: str) -> list[str]:
    """Return expressions, in compiled code, for what a table tells of.

    Args:
        forms: of what it tells of.
        table: the name of the table's numbers.
    """
    expressions, place = list[str](), 0
    for dtype, axes in forms:
        lengths = "".join(f"{table}[{place + 1 + axis}], " for axis in range(axes)) or "1, "
        array = f"array_at(pointer({table}[{place}]), ({lengths}), {dtype}_)"
        expressions.append(array if axes else f"{array}[0]")
        place += 1 + axes
    return expressions


def pointer(address: int) -> Any:
    """Return an address as a pointer; in compiled code."""
    raise NotImplementedError


@type_callable(pointer)
def _type_of_pointer(context: Any) -> Any:
    return lambda address: types.voidptr


@lower_builtin(pointer, types.int64)
def _code_of_pointer(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    return builder.inttoptr(arguments[0], cgutils.voidptr_t)


SCOPE: dict[str, Any] = {
    "array_at": carray,
    "pointer": pointer,
    **{f"{name}_": kind for name, kind in _TYPES.items()},
}
"""What the expressions of `found` use, by name."""
