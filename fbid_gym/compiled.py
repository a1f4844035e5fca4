"""Compilation of the loops over robots that every control tick runs, and their door to Python.

A tick of one robot is some ten thousand multiplications: a few microseconds, and a hundred times as
much if each array operation on the way is a call of its own. So what runs at every tick is compiled
by Numba, one robot after another: `@kernel` on functions that Python calls too, `@compiled` on
those that only compiled code calls.

Rules for both:

- Arguments are named tuples (`fbid_gym.quantities`), C-contiguous arrays of float64, bool or int64
  with the batch axis first, and numbers; results likewise, in fresh arrays. A slice of an array of
  one robot is contiguous and that of many is not, so slices would be compiled twice, and rounded
  differently. A function that writes to an argument says so.
- Whoever makes a tuple checks shapes and types.
- Nothing raises. A robot that is not finite gets results that are not, and the others do not
  notice.

Inside compiled code a named tuple costs nothing. On the way in from Python, Numba takes a
microsecond for each: so `kernel` makes a door. It compiles an entry that takes the fields one by
one and builds the tuples inside, and gives Python a function that passes the fields on.

Entries are compiled on first use and then kept on disk (`fbid_gym.compile_cache`). Python's lock is
released while they run.
"""

import inspect
from collections.abc import Callable
from functools import update_wrapper
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from numba import njit
from numba.extending import overload

from fbid_gym.compile_cache import folders, kept

Function = TypeVar("Function", bound=Callable[..., Any])

_PLACES = folders(Path(__file__).parent)
# Division by zero gives infinity, as in NumPy. Sums may be taken in any order, and so side by side.
_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"reassoc", "contract"}}


def compiled(function: Function) -> Function:
    """Compile a function for the use of kernels."""
    return njit(**_OPTIONS)(function)


def kernel(function: Function) -> Function:
    """Compile an annotated function for the use of Python and of other kernels.

    Args:
        function: its annotations say which arguments, and whether the result, are named tuples.

    Returns:
        A function with the same arguments, all of them positional; its attribute `entry` is what
        Numba made.
    """
    kinds = get_type_hints(function)
    result = kinds.pop("return")
    names = ", ".join(kinds)
    scope: dict[str, Any] = {"body": njit(**_OPTIONS)(function)}
    fields: list[str] = []
    leaves: list[str] = []
    built = ", ".join(_built(kind, name, scope, fields) for name, kind in kinds.items())
    passed = ", ".join(part for name, kind in kinds.items() for part in _parts(kind, name))

    source = f"def entry({', '.join(fields)}):\n    found = body({built})\n"
    if _is_tuple(result):
        # Numba takes longer to make a named tuple for Python than a plain one.
        source += f"    return {', '.join(_leaves(result, 'found'))},\n"
        returned = _built(result, "found", scope, leaves)
        door = f"    {', '.join(leaves)}, = entry({passed})\n    return {returned}\n"
    else:
        source += "    return found\n"
        door = f"    return entry({passed})\n"
    # Under the function's own file name, so that errors show its lines.
    file = function.__code__.co_filename
    exec(compile(source, file, "exec"), scope)
    entry = scope["entry"]
    entry.__qualname__, entry.__module__ = function.__qualname__, function.__module__
    scope["entry"] = kept(njit(**_OPTIONS)(entry), _PLACES)
    exec(compile(f"def door({names}):\n{door}", file, "exec"), scope)
    exec(f"def implementation({names}):\n    return function", {"function": function}, scope)
    own, implementation = scope["door"], scope["implementation"]
    update_wrapper(own, function)
    own.entry = scope["entry"]
    implementation.__signature__ = inspect.signature(function)
    overload(own, jit_options=_OPTIONS)(implementation)
    return own


def _is_tuple(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


def _built(kind: Any, name: str, scope: dict[str, Any], fields: list[str]) -> str:
    """An expression that makes an argument of its fields, whose names join `fields`."""
    if not _is_tuple(kind):
        fields.append(name)
        return name
    scope[kind.__name__] = kind
    hints = get_type_hints(kind)
    parts = (_built(hints[field], f"{name}_{field}", scope, fields) for field in kind._fields)
    return f"{kind.__name__}({', '.join(parts)})"


def _parts(kind: Any, value: str) -> list[str]:
    """Expressions for the fields of a value, as few as it takes."""
    if not _is_tuple(kind):
        return [value]
    hints = get_type_hints(kind)
    if not any(_is_tuple(hint) for hint in hints.values()):
        return [f"*{value}"]
    return [part for field in kind._fields for part in _parts(hints[field], f"{value}.{field}")]


def _leaves(kind: Any, value: str) -> list[str]:
    """Expressions for the fields of a value, one by one."""
    if not _is_tuple(kind):
        return [value]
    hints = get_type_hints(kind)
    return [leaf for field in kind._fields for leaf in _leaves(hints[field], f"{value}.{field}")]
