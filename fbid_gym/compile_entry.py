"""Call a kernel from Python: its entry, which Numba compiles, and its door, in Python.

A named tuple crosses the border between them as its fields, and those of the tuples among them: its
leaves, arrays and numbers. The functions here write source code that says how.
"""

from collections.abc import Callable
from typing import Any, get_type_hints


def is_tuple(kind: Any) -> bool:
    """Return whether an annotation is a named tuple."""
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


def entry_to(part: Callable[..., Any], kinds: dict[str, Any]) -> Callable[..., Any]:
    """Return a function of the leaves of a part's arguments, which returns those of its result."""
    arguments, result = [name for name in kinds if name != "return"], kinds["return"]
    scope: dict[str, Any] = {"part": part}
    taken = [leaf.replace(".", "_") for name in arguments for leaf in _leaves(kinds[name], name)]
    built = [_built(kinds[name], name, scope) for name in arguments]
    # Numba takes longer to make a named tuple for Python than a plain one.
    given = f"{', '.join(_leaves(result, 'found'))}," if is_tuple(result) else "found"
    body = f"    found = part({', '.join(built)})\n    return {given}\n"
    return _made(f"def {part.__name__}({', '.join(taken)}):\n{body}", scope, part)


def door_to(entry: Callable[..., Any], kinds: dict[str, Any]) -> Callable[..., Any]:
    """Return a function of arguments of these kinds, which passes on their leaves to an entry."""
    arguments, result = [name for name in kinds if name != "return"], kinds["return"]
    scope: dict[str, Any] = {"entry": entry}
    given = [part for name in arguments for part in _passed(kinds[name], name)]
    call = f"entry({', '.join(given)})"
    body = f"    return {call}\n"
    if is_tuple(result):
        names = [leaf.replace(".", "_") for leaf in _leaves(result, "found")]
        body = f"    {', '.join(names)}, = {call}\n    return {_built(result, 'found', scope)}\n"
    return _made(f"def door({', '.join(arguments)}):\n{body}", scope, entry)


def _made(source: str, scope: dict[str, Any], like: Any) -> Callable[..., Any]:
    exec(source, scope)
    made: Callable[..., Any] = scope.popitem()[1]
    made.__module__, made.__qualname__ = like.__module__, like.__qualname__
    return made


def _leaves(kind: Any, value: str) -> list[str]:
    """Expressions for the leaves of a value, one by one."""
    if not is_tuple(kind):
        return [value]
    hints = get_type_hints(kind)
    return [leaf for field in kind._fields for leaf in _leaves(hints[field], f"{value}.{field}")]


def _passed(kind: Any, value: str) -> list[str]:
    """Expressions for the leaves of a value, as few as it takes."""
    if not is_tuple(kind):
        return [value]
    hints = get_type_hints(kind)
    if not any(is_tuple(hint) for hint in hints.values()):
        return [f"*{value}"]
    return [part for field in kind._fields for part in _passed(hints[field], f"{value}.{field}")]


def _built(kind: Any, value: str, scope: dict[str, Any]) -> str:
    """An expression that makes a value of variables with its leaves; its tuples join the scope."""
    if not is_tuple(kind):
        return value.replace(".", "_")
    own, hints = f"{kind.__name__}_{value}".replace(".", "_"), get_type_hints(kind)
    scope[own] = kind
    parts = [_built(hints[field], f"{value}.{field}", scope) for field in kind._fields]
    return f"{own}({', '.join(parts)})"
