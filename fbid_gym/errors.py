"""The errors a user can cause, each naming the offending value and the valid choices.

Everything raised on purpose by fbid_gym derives from `FbidError`, so one `except` catches all of
it. Errors are raised at the boundary, before any state changes or any file is written, and carry
the data they talk about.
"""

import re
import reprlib
from collections.abc import Iterable

_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxlong = 6, 60
_SHORT.maxstring = _SHORT.maxother = 400
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = _SHORT.maxset = _SHORT.maxfrozenset = 40


def shown(value: object) -> str:
    """Return a value as messages show it: on one line, cut where it is long, whatever it is."""
    try:
        return re.sub(r"\n\s*", " ", _SHORT.repr(value))
    except Exception:  # a repr of its own that fails, or an integer of too many digits
        return f"<{type(value).__name__}>"


class FbidError(Exception):
    """Root of all errors raised by fbid_gym."""


class UnknownOptionError(FbidError):
    """A name that is not among the valid choices.

    Attributes:
        kind: what the name stands for, such as "action layer".
        value: the name that was given.
        choices: the valid names.
    """

    def __init__(self, kind: str, value: object, choices: Iterable[str]) -> None:
        """Store the data and build the message."""
        self.kind, self.value, self.choices = kind, value, tuple(choices)
        super().__init__(
            f"Unknown {kind} {shown(value)}. Valid choices: {', '.join(self.choices)}."
        )


class InvalidValueError(FbidError):
    """A value outside what an argument accepts.

    Attributes:
        name: the argument.
        value: what was given.
        expected: what is valid, in words.
    """

    def __init__(self, name: str, value: object, expected: str) -> None:
        """Store the data and build the message."""
        self.name, self.value, self.expected = name, value, expected
        super().__init__(f"Invalid {name}: {shown(value)}. Expected {expected}.")


class ShapeError(FbidError):
    """An array whose shape does not fit.

    Attributes:
        name: the array.
        shape: its shape.
        expected: the shape it should have, in words.
    """

    def __init__(self, name: str, shape: tuple[int, ...], expected: str) -> None:
        """Store the data and build the message."""
        self.name, self.shape, self.expected = name, shape, expected
        super().__init__(f"{name} has shape {shape}. Expected {expected}.")


class NonFiniteError(FbidError):
    """An array that holds NaN or infinity.

    Attributes:
        name: the array.
        where: indices of the first offending entry.
    """

    def __init__(self, name: str, where: tuple[int, ...]) -> None:
        """Store the data and build the message."""
        self.name, self.where = name, where
        super().__init__(f"{name} is not finite: first NaN or infinity at index {where}.")


class RobotError(FbidError):
    """A robot description that cannot be used, with the reason."""


class PolicyFileError(FbidError):
    """A policy file that is missing, truncated, corrupt, or made for another environment."""


class RunError(FbidError):
    """A run folder that is missing, incomplete, or does not fit what is asked of it."""
