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

import ast
import inspect
import textwrap
from collections.abc import Callable
from functools import update_wrapper
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from numba import njit
from numba.extending import overload

from fbid_gym.compile_cache import folders, kept
from fbid_gym.compile_parts import part, part_options

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
    return part(function, _OPTIONS)


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
    names, tuples = list(kinds), dict[str, Any]()
    fields: list[str] = []
    built = {name: _built(kind, name, tuples, fields) for name, kind in kinds.items()}
    made = [f"{name} = {value}" for name, value in built.items() if value != name]
    entry = kept(njit(**_OPTIONS)(_entry(function, fields, made, result, tuples)), _PLACES)

    passed = ", ".join(part for name, kind in kinds.items() for part in _parts(kind, name))
    scope, leaves = {"entry": entry, "function": function}, list[str]()
    body = f"    return entry({passed})\n"
    if _is_tuple(result):
        returned = _built(result, "found", scope, leaves)
        body = f"    {', '.join(leaves)}, = entry({passed})\n    return {returned}\n"
    exec(f"def door({', '.join(names)}):\n{body}", scope)
    exec(f"def implementation({', '.join(names)}):\n    return function", scope)
    door, implementation = scope["door"], scope["implementation"]
    update_wrapper(door, function)
    door.entry = entry
    implementation.__signature__ = inspect.signature(function)
    overload(door, jit_options=part_options(_OPTIONS))(implementation)
    return door


def _entry(
    function: Callable[..., Any],
    fields: list[str],
    made: list[str],
    result: Any,
    tuples: dict[str, Any],
) -> Callable[..., Any]:
    """The function with the fields of its arguments for arguments, and those of its result.

    It is rewritten and not called, which would compile it twice: as itself, and in the entry.

    Args:
        function: to be rewritten.
        fields: names of the new arguments.
        made: assignments that make the old ones of them.
        result: what it returns.
        tuples: name in those assignments -> named tuple.
    """
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    node = tree.body[0]
    assert isinstance(node, ast.FunctionDef)
    node.decorator_list, node.returns = [], None
    node.args = ast.arguments([], [ast.arg(field) for field in fields], None, [], [], None, [])
    if _is_tuple(result):
        # Numba takes longer to make a named tuple for Python than a plain one.
        node = _Flattened(_leaves(result, "found")).visit(node)
    node.body[:0] = ast.parse("\n".join(made)).body
    maker = ast.parse(f"def maker({', '.join(tuples)}):\n    return {node.name}")
    assert isinstance(maker.body[0], ast.FunctionDef)
    maker.body[0].body.insert(0, node)
    # Errors show the lines of the function itself.
    ast.increment_lineno(node, function.__code__.co_firstlineno - 1)
    code = compile(ast.fix_missing_locations(maker), function.__code__.co_filename, "exec")
    scope: dict[str, Any] = {}
    exec(code, function.__globals__, scope)
    entry: Callable[..., Any] = scope["maker"](**tuples)
    entry.__qualname__ = function.__qualname__
    return entry


class _Flattened(ast.NodeTransformer):
    """Returns the fields of a named tuple one by one."""

    def __init__(self, leaves: list[str]) -> None:
        self._source = f"return {', '.join(leaves)},"

    def visit_Return(self, node: ast.Return) -> list[ast.stmt]:  # noqa: N802
        assert node.value is not None
        keep = ast.Assign([ast.Name("found", ast.Store())], node.value)
        return [ast.copy_location(x, node) for x in (keep, *ast.parse(self._source).body)]


def _is_tuple(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


def _built(kind: Any, name: str, tuples: dict[str, Any], fields: list[str]) -> str:
    """An expression that makes a value of its fields, whose names join `fields`.

    The named tuples that it calls join `tuples`, under names of their own.
    """
    if not _is_tuple(kind):
        fields.append(name)
        return name
    own = f"{kind.__name__}_{name}"
    tuples[own] = kind
    hints = get_type_hints(kind)
    parts = [_built(hints[field], f"{name}_{field}", tuples, fields) for field in kind._fields]
    return f"{own}({', '.join(parts)})"


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
