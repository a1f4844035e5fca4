"""What Numba compiles of a kernel: its source, rewritten to take and return plain arguments.

A named tuple crosses the border between Python and compiled code as its fields, and those of the
tuples among them: its leaves, arrays and numbers. The functions here say how, in source code.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable
from typing import Any, get_type_hints


def is_tuple(kind: Any) -> bool:
    """Return whether an annotation is a named tuple."""
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


def leaves(kind: Any, value: str) -> list[str]:
    """Return expressions for the leaves of a value, one by one."""
    if not is_tuple(kind):
        return [value]
    hints = get_type_hints(kind)
    return [leaf for field in kind._fields for leaf in leaves(hints[field], f"{value}.{field}")]


def passed(kind: Any, value: str) -> list[str]:
    """Return expressions for the leaves of a value, as few as it takes."""
    if not is_tuple(kind):
        return [value]
    hints = get_type_hints(kind)
    if not any(is_tuple(hint) for hint in hints.values()):
        return [f"*{value}"]
    return [part for field in kind._fields for part in passed(hints[field], f"{value}.{field}")]


def built(kind: Any, name: str, scope: dict[str, Any], leaf: Callable[[str], str]) -> str:
    """Return an expression that makes a value of its leaves.

    Args:
        kind: annotation of the value.
        name: of the value.
        scope: the named tuples that it calls join, under names of their own.
        leaf: from the name of a leaf to an expression for it; asked in the order of `leaves`.
    """
    if not is_tuple(kind):
        return leaf(name)
    own = f"{kind.__name__}_{name}"
    scope[own] = kind
    hints = get_type_hints(kind)
    parts = [built(hints[field], f"{name}_{field}", scope, leaf) for field in kind._fields]
    return f"{own}({', '.join(parts)})"


def rewritten(
    function: Callable[..., Any],
    arguments: list[str],
    made: list[str],
    result: Any,
    scope: dict[str, Any],
) -> Callable[..., Any]:
    """Return a function with other arguments, whose result is the leaves of its own.

    It is rewritten and not called, which would compile it twice: as itself, and in the entry.

    Args:
        function: to be rewritten.
        arguments: names of the new ones.
        made: assignments that make the old ones of them.
        result: what it returns.
        scope: what these assignments use, by name.
    """
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    node = tree.body[0]
    assert isinstance(node, ast.FunctionDef)
    node.decorator_list, node.returns = [], None
    node.args = ast.arguments([], [ast.arg(name) for name in arguments], None, [], [], None, [])
    if is_tuple(result):
        # Numba takes longer to make a named tuple for Python than a plain one.
        node = _Flattened(leaves(result, "found")).visit(node)
    node.body[:0] = ast.parse("\n".join(made)).body
    maker = ast.parse(f"def maker({', '.join(scope)}):\n    return {node.name}")
    assert isinstance(maker.body[0], ast.FunctionDef)
    maker.body[0].body.insert(0, node)
    # Errors show the lines of the function itself.
    ast.increment_lineno(node, function.__code__.co_firstlineno - 1)
    code = compile(ast.fix_missing_locations(maker), function.__code__.co_filename, "exec")
    found: dict[str, Any] = {}
    exec(code, function.__globals__, found)
    entry: Callable[..., Any] = found["maker"](**scope)
    entry.__qualname__ = function.__qualname__
    return entry


class _Flattened(ast.NodeTransformer):
    """Returns the leaves of a named tuple one by one."""

    def __init__(self, expressions: list[str]) -> None:
        self._source = f"return {', '.join(expressions)},"

    def visit_Return(self, node: ast.Return) -> list[ast.stmt]:  # noqa: N802
        assert node.value is not None
        keep = ast.Assign([ast.Name("found", ast.Store())], node.value)
        return [ast.copy_location(x, node) for x in (keep, *ast.parse(self._source).body)]
