"""Compilation of the loops over robots that every control tick runs, and their door to Python.

A tick of one robot is some ten thousand multiplications: a few microseconds, and a hundred times as
much if each array operation on the way is a call of its own. So what runs at every tick is compiled
by Numba, one robot after another: `@kernel` on functions that Python calls too, `@compiled` on
those that only compiled code calls.

Rules for both:

- Arguments are named tuples (`fbid_gym.quantities`), C-contiguous arrays of float64, bool or int64
  (MuJoCo's own also of int32) with the batch axis first, and numbers; results likewise, in fresh
  arrays. A slice of an array of one robot is contiguous and that of many is not, so slices would be
  compiled twice, and rounded differently. A function that writes to an argument says so.
- Whoever makes a tuple checks shapes and types.
- Nothing raises. A robot that is not finite gets results that are not, and the others do not
  notice.

Inside compiled code a named tuple costs nothing. On the way in from Python, Numba takes a
microsecond for each: so `kernel` makes a door. It compiles an entry that takes the fields one by
one and builds the tuples inside, and gives Python a function that passes the fields on. That is
60 ns an array, and laws have dozens that never change: `bind` hands those over once.

Entries are compiled on first use and then kept on disk (`fbid_gym.compile_cache`). Python's lock is
released while they run.
"""

import inspect
from collections.abc import Callable, Sequence
from functools import update_wrapper
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeVar, get_type_hints

from numba import njit
from numba.extending import overload

from fbid_gym.compile_cache import folders, kept
from fbid_gym.compile_entry import built, is_tuple, leaves, passed, rewritten
from fbid_gym.compile_parts import part, part_options
from fbid_gym.compile_table import SCOPE, Form, Table, found

Function = TypeVar("Function", bound=Callable[..., Any])

_PLACES = folders(Path(__file__).parent)
# Division by zero gives infinity, as in NumPy. Sums may be taken in any order, and so side by side.
# Nobody calls from C: without a wrapper for that, there is less to compile.
_OPTIONS = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"reassoc", "contract"},
    "no_cfunc_wrapper": True,
}


def compiled(function: Function) -> Function:
    """Compile a function for the use of kernels."""
    return part(function, _OPTIONS, _takes_tuples(function))


def kernel(function: Function) -> Function:
    """Compile an annotated function for the use of Python and of other kernels.

    Args:
        function: its annotations say which arguments, and whether the result, are named tuples.

    Returns:
        A function with the same arguments, all of them positional; its attribute `entries` is what
        Numba made, by the forms of what is bound of the arguments.
    """
    kinds = get_type_hints(function)
    door = _door(kinds, _entry(function))
    update_wrapper(door, function)
    door.entries = {(): door.entry}
    scope: dict[str, Any] = {"function": function}
    names = inspect.signature(function).parameters
    exec(f"def implementation({', '.join(names)}):\n    return function", scope)
    implementation = scope["implementation"]
    implementation.__signature__ = inspect.signature(function)
    overload(door, jit_options=part_options(_OPTIONS, _takes_tuples(function)))(implementation)
    return door


def bind(door: Any, *first: Any) -> Callable[..., Any]:
    """Return a kernel without its first arguments, which are the same at every call.

    Args:
        door: what `kernel` made; it returns none of these arguments.
        first: the arguments. Arrays are not copied: what they hold at a call counts.

    Returns:
        A function of the other arguments, all of them positional. It keeps the first alive, and
        cannot be pickled.
    """
    function = door.__wrapped__
    kinds = get_type_hints(function)
    bound = {name: kinds.pop(name) for name in list(kinds)[: len(first)]}
    values = SimpleNamespace(**dict(zip(bound, first, strict=True)))
    named = [leaf for name, kind in bound.items() for leaf in leaves(kind, name)]
    table = Table.of({leaf: attrgetter(leaf)(values) for leaf in named})
    if table.forms not in door.entries:
        # Of threads that are here at once one entry stays.
        door.entries.setdefault(table.forms, _entry(function, table.forms))
    return _door(kinds, door.entries[table.forms], table)


def _takes_tuples(function: Callable[..., Any]) -> bool:
    """Whether a function takes named tuples, or may.

    Passing their fields on costs more than it seems, so such a function is inlined. What takes
    arrays is left to the compiler's own choice: linear algebra everywhere is long to compile.
    """
    kinds = get_type_hints(function)
    return any(kind is Any or is_tuple(kind) for name, kind in kinds.items() if name != "return")


def _entry(function: Callable[..., Any], bound: Sequence[Form] = ()) -> Any:
    """What Numba makes of a function; the first leaves of its arguments are told of in a table."""
    kinds = get_type_hints(function)
    result = kinds.pop("return")
    scope, arguments = (dict(SCOPE), ["table"]) if bound else ({}, [])
    told = iter(found(bound, "table"))

    def leaf(name: str) -> str:
        expression = next(told, None)
        if expression is None:
            arguments.append(name)
        return expression or name

    values = {name: built(kind, name, scope, leaf) for name, kind in kinds.items()}
    made = [f"{name} = {value}" for name, value in values.items() if value != name]
    return kept(njit(**_OPTIONS)(rewritten(function, arguments, made, result, scope)), _PLACES)


def _door(kinds: dict[str, Any], entry: Any, table: Table | None = None) -> Any:
    """What Python calls: a function of arguments of these kinds, which passes on their leaves."""
    arguments = {name: kind for name, kind in kinds.items() if name != "return"}
    given = [part for name, kind in arguments.items() for part in passed(kind, name)]
    scope: dict[str, Any] = {"entry": entry}
    if table is not None:
        given.insert(0, "table")
        scope["table"] = table.numbers
    call, result = f"entry({', '.join(given)})", kinds["return"]
    body = f"    return {call}\n"
    if is_tuple(result):
        value = built(result, "found", scope, lambda name: name)
        names = [leaf.replace(".", "_") for leaf in leaves(result, "found")]
        body = f"    {', '.join(names)}, = {call}\n    return {value}\n"
    exec(f"def door({', '.join(arguments)}):\n{body}", scope)
    door = scope.pop("door")  # left there it would be a part of a cycle, and outlive its use
    door.__qualname__ = door.__name__ = entry.__name__
    door.entry, door.table = entry, table  # the table keeps its arrays
    return door
