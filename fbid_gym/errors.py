"""The errors a user can cause, each naming the offending value and the valid choices.

Everything raised on purpose by fbid_gym derives from `FbidError`, so one `except` catches all of
it. Errors are raised at the boundary, before any state changes or any file is written, and carry
the data they talk about. Those about values and keywords are also Python's own `ValueError` and
`TypeError`, which other libraries catch. These raise them anew with a text of theirs, as
`type(error)(text)`: each error can be made of its message alone.
"""

import difflib
import re
import reprlib
from collections.abc import Iterable

_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxlong = 6, 60
_SHORT.maxstring = _SHORT.maxother = 400
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = _SHORT.maxset = _SHORT.maxfrozenset = 40

_MOST_LISTED = 20  # choices
_LIKE, _SLIP = 0.5, 0.86  # least likeness of names, and of slips, as difflib measures it


def shown(value: object) -> str:
    """Return a value as messages show it: on one line, cut where it is long, whatever it is."""
    try:
        return re.sub(r"\n\s*", " ", _SHORT.repr(value))
    except Exception:  # a repr of its own that fails, or an integer of too many digits
        return f"<{type(value).__name__}>"


class FbidError(Exception):
    """Root of all errors raised by fbid_gym."""


class UnknownOptionError(FbidError, ValueError):
    """A name that is not among the valid choices.

    Attributes:
        kind: what the name stands for, such as "action layer" or "option of task 'walk'".
        value: the name that was given.
        choices: the valid names.
    """

    def __init__(
        self, kind: str, value: object = None, choices: Iterable[str] | None = None
    ) -> None:
        """Store the data and build the message; without choices, `kind` is the message."""
        self.kind, self.value, self.choices = kind, value, tuple(choices or ())
        super().__init__(kind if choices is None else self._message())

    def _message(self) -> str:
        what = re.split(" of | in ", self.kind, maxsplit=1)[0]
        return f"Unknown {what} {shown(self.value)}{self.kind[len(what) :]}. {self._hint()}"

    def _hint(self) -> str:
        """The choices in words; of many those most like the value."""
        value = self.value if type(self.value) is str else ""
        hint = "".join(
            f"Did you mean {name!r}? "
            for name in difflib.get_close_matches(value, self.choices, 1, _SLIP)
        )
        like = difflib.get_close_matches(value, self.choices, 5, _LIKE)
        if not like or len(self.choices) <= _MOST_LISTED:
            return f"{hint}Valid choices: {', '.join(self.choices)}."
        return f"{hint}Nearest of {len(self.choices)} choices: {', '.join(like)}."


class UnknownArgumentError(UnknownOptionError, TypeError):
    """A keyword argument that there is not; `kind` is what does not take it."""

    def _message(self) -> str:
        return f"{self.kind} got an unexpected keyword argument {shown(self.value)}. {self._hint()}"


class InvalidValueError(FbidError, ValueError):
    """A value outside what an argument accepts.

    Attributes:
        name: the argument.
        value: what was given.
        expected: what is valid, in words.
    """

    def __init__(self, name: str, value: object = None, expected: str | None = None) -> None:
        """Store the data and build the message; without `expected`, `name` is the message."""
        self.name, self.value, self.expected = name, value, expected
        invalid = f"Invalid {name}: {shown(value)}. Expected {expected}."
        super().__init__(name if expected is None else invalid)


class ShapeError(FbidError, ValueError):
    """An array whose shape does not fit.

    Attributes:
        name: the array.
        shape: its shape.
        expected: the shape it should have, in words.
    """

    def __init__(self, name: str, shape: tuple[int, ...] = (), expected: str | None = None) -> None:
        """Store the data and build the message; without `expected`, `name` is the message."""
        self.name, self.shape, self.expected = name, shape, expected
        misfit = f"{name} has shape {shape}. Expected {expected}."
        super().__init__(name if expected is None else misfit)


class NonFiniteError(FbidError, ValueError):
    """An array that holds NaN or infinity.

    Attributes:
        name: the array.
        where: indices of the first offending entry.
    """

    def __init__(self, name: str, where: tuple[int, ...] | None = None) -> None:
        """Store the data and build the message; without `where`, `name` is the message."""
        self.name, self.where = name, where
        infinite = f"{name} is not finite: first NaN or infinity at index {where}."
        super().__init__(name if where is None else infinite)


class RobotError(FbidError):
    """A robot description that cannot be used, with the reason."""


class PolicyFileError(FbidError):
    """A policy file that is missing, truncated, corrupt, or made for another environment."""


class RunError(FbidError):
    """A run folder that is missing, incomplete, or does not fit what is asked of it."""
