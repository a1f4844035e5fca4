"""Options as data: which values each takes is said beside it, and checked in one place.

A keyword argument of a constructor, or a field of a dataclass, says in its annotation what it
takes:

    scale: Annotated[float, Number(1e-6, 100.0, "rad")] = 0.3
    gait: Annotated[str, Choice(("trot", "pace"))] | None = None
    height_scan: bool = False

`checked` holds a constructor's arguments to that, `check_fields` a dataclass's fields; `options_of`
lists them, for errors and for documentation. What says nothing is checked where it is understood.
"""

import functools
import inspect
import types
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import (
    Annotated,
    Any,
    ParamSpec,
    Protocol,
    TypeVar,
    Union,
    get_args,
    get_origin,
    runtime_checkable,
)

import numpy as np

from fbid_gym.checks import by_name, is_number
from fbid_gym.errors import InvalidValueError, UnknownOptionError

P = ParamSpec("P")
T = TypeVar("T")


@runtime_checkable
class Kind(Protocol):
    """Values that an option takes."""

    @property
    def words(self) -> str:
        """In words, as in "a number from 0 to 1"."""

    def check(self, name: str, value: Any) -> Any:
        """Return the value as the code behind takes it, or raise an FbidError that names it."""


@dataclass(frozen=True)
class Number:
    """A number from `least` to `most`."""

    least: float
    most: float
    unit: str = ""

    @property
    def words(self) -> str:
        """See `Kind`."""
        return f"a number {self.span}"

    @property
    def span(self) -> str:
        """From where to where."""
        unit = f" {self.unit}" if self.unit else ""
        if self.most == np.inf:
            return f"of at least {_text(self.least)}{unit}"
        return f"from {_text(self.least)} to {_text(self.most)}{unit}"

    def holds(self, value: Any) -> bool:
        """Return whether it is such a number."""
        return is_number(value) and bool(self.least <= value <= self.most)

    def check(self, name: str, value: Any) -> float:
        """See `Kind`."""
        if self.holds(value):
            return float(value)
        raise InvalidValueError(name, value, self.words)


@dataclass(frozen=True)
class Whole(Number):
    """A whole number from `least` to `most`, which may be given as a float."""

    @property
    def words(self) -> str:
        """See `Kind`."""
        return f"a whole number {self.span}"

    def check(self, name: str, value: Any) -> int:
        """See `Kind`."""
        if self.holds(value) and float(value).is_integer():
            return int(value)
        raise InvalidValueError(name, value, self.words)


@dataclass(frozen=True)
class Pair:
    """Two numbers (least, most) from `least` to `most`."""

    least: float
    most: float
    unit: str = ""

    @property
    def words(self) -> str:
        """See `Kind`."""
        unit = f" {self.unit}" if self.unit else ""
        return f"a pair {_text(self.least)} <= least <= most <= {_text(self.most)}{unit}"

    def check(self, name: str, value: Any) -> tuple[float, float]:
        """See `Kind`."""
        number = Number(self.least, self.most)
        # Only what has an order and an end.
        listed = isinstance(value, Sequence) or (isinstance(value, np.ndarray) and value.ndim == 1)
        if listed and len(value) == 2:
            first, last = value
            if number.holds(first) and number.holds(last) and first <= last:
                return float(first), float(last)
        raise InvalidValueError(name, value, self.words)


@dataclass(frozen=True)
class Flag:
    """True or False."""

    words: str = "True or False"

    def check(self, name: str, value: Any) -> bool:
        """See `Kind`."""
        if isinstance(value, bool | np.bool_):
            return bool(value)
        raise InvalidValueError(name, value, self.words)


@dataclass(frozen=True, eq=False)
class Choice:
    """One of a few names; `what` they stand for, where that is not the option's own name."""

    names: Collection[str]
    what: str = ""

    @property
    def words(self) -> str:
        """See `Kind`."""
        return ", ".join(f'"{name}"' for name in self.names)

    def check(self, name: str, value: Any) -> str:
        """See `Kind`."""
        if isinstance(value, str) and value in self.names:
            return value
        raise UnknownOptionError(self.what or name, value, self.names)


@dataclass(frozen=True)
class Each:
    """`least` values or more, each of a kind."""

    kind: Kind
    least: int = 1

    @property
    def words(self) -> str:
        """See `Kind`."""
        return f"{'one' if self.least else 'none'} or more, each {self.kind.words}"

    def check(self, name: str, value: Any) -> tuple[Any, ...]:
        """See `Kind`."""
        if not isinstance(value, list | tuple) or len(value) < self.least:
            raise InvalidValueError(name, value, self.words)
        return tuple(self.kind.check(name, one) for one in value)


@dataclass(frozen=True)
class Named:
    """Values by name, each of a kind."""

    kind: Kind

    @property
    def words(self) -> str:
        """See `Kind`."""
        return f"a dictionary from names to values, each {self.kind.words}"

    def check(self, name: str, value: Any) -> dict[str, Any]:
        """See `Kind`."""
        return {
            key: self.kind.check(f"{name}[{key!r}]", one)
            for key, one in by_name(name, value).items()
        }


@dataclass(frozen=True)
class Option:
    """An option: its name, its default, and what it takes.

    Attributes:
        name: by which it is given.
        default: what it is unless given.
        kind: None where what it takes is checked elsewhere.
        optional: whether None is a value.
    """

    name: str
    default: Any
    kind: Kind | None
    optional: bool

    def check(self, value: Any, called: str = "{}") -> Any:
        """Return a value as the code behind takes it, or raise an FbidError that names it."""
        if value is self.default or self.kind is None or (value is None and self.optional):
            return value
        return self.kind.check(called.format(self.name), value)


def checked(build: Callable[P, T]) -> Callable[P, T]:
    """Hold the keyword-only arguments of a constructor to what their annotations say."""
    known = {option.name: option for option in _keywords(build)}

    @functools.wraps(build)
    def door(*args: P.args, **given: P.kwargs) -> T:
        for name, value in given.items():
            if name in known:
                given[name] = known[name].check(value)
        return build(*args, **given)

    return door


def check_fields(values: Any, called: str = "{}") -> None:
    """Hold the fields of a frozen dataclass to what their annotations say, from `__post_init__`.

    Args:
        values: the dataclass; its fields become what the code behind takes.
        called: what errors call a field, {} being its name.
    """
    for option in _fields(type(values)):
        object.__setattr__(values, option.name, option.check(getattr(values, option.name), called))


def options_of(build: Callable[..., Any]) -> dict[str, Option]:
    """Return the options of a constructor by name: its keyword-only arguments; or its fields.

    Those that stand together in a dataclass are listed one by one.
    """
    if is_dataclass(build):
        return {option.name: option for option in _fields(build)}
    return {
        own.name: own
        for option in _keywords(build)
        for own in (_fields(type(option.default)) if is_dataclass(option.default) else [option])
    }


def grouped(build: Callable[..., Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return options that are given one by one as a constructor takes them, see `options_of`."""
    rest, groups = dict(given), {}
    for option in _keywords(build):
        if is_dataclass(option.default) and not isinstance(option.default, type):
            own = {n: rest.pop(n) for n in options_of(type(option.default)) if n in rest}
            if own:
                groups[option.name] = replace(option.default, **own)
    return rest | groups


def check_own_name(what: str, name: Any, taken: Collection[str]) -> None:
    """Raise InvalidValueError unless it is a name that a user may give to what is the user's."""
    if not isinstance(name, str) or not name.isidentifier() or name in taken:
        expected = f"letters, digits and underscores, and none of {', '.join(taken)}"
        raise InvalidValueError(f"name of {what}", name, expected)


def check_call(name: str, build: Any, arguments: Sequence[str]) -> None:
    """Raise InvalidValueError unless a user's constructor takes these arguments, and needs no more.

    Args:
        name: of what it builds.
        build: the constructor.
        arguments: in words.
    """
    try:
        inspect.signature(build).bind(*arguments)
    except (TypeError, ValueError):
        expected = (
            f"what can be called as ({', '.join(arguments)}), its options being keyword-only "
            "arguments with defaults"
        )
        raise InvalidValueError(f"constructor of {name}", build, expected) from None


@functools.cache
def _keywords(build: Callable[..., Any]) -> tuple[Option, ...]:
    return tuple(
        _option(parameter.name, parameter.default, parameter.annotation)
        for parameter in inspect.signature(build).parameters.values()
        if parameter.kind is parameter.KEYWORD_ONLY
    )


_fields: Callable[[Any], tuple[Option, ...]] = functools.cache(
    lambda kind: tuple(_option(field.name, field.default, field.type) for field in fields(kind))
)


def _option(name: str, default: Any, annotation: Any) -> Option:
    several = get_origin(annotation) in (Union, types.UnionType)
    parts = get_args(annotation) if several else (annotation,)
    said = [word for part in parts if get_origin(part) is Annotated for word in get_args(part)[1:]]
    found: list[Kind] = [word for word in said if isinstance(word, Kind)]
    if bool in parts:
        found.append(Flag())
    return Option(name, default, found[0] if found else None, types.NoneType in parts)


def _text(bound: float) -> str:
    if isinstance(bound, int):
        return f"{bound:,}"
    return f"{bound:,.0f}" if abs(bound) >= 1000 else np.format_float_positional(bound, trim="-")
