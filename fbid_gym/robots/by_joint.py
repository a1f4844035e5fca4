"""Values that a user gives for joints: one for all, or by name or pattern."""

from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase

from fbid_gym.checks import check_positive
from fbid_gym.errors import UnknownOptionError

# One number for every joint, or joint name or pattern ("*_knee") -> number.
ByJoint = float | Mapping[str, float]


def by_joint(what: str, given: ByJoint | None, joints: Sequence[str]) -> dict[str, float]:
    """Return joint name -> value, for the joints that `given` speaks of; later patterns win.

    Each has to fit a joint (UnknownOptionError), and its value to be positive (InvalidValueError).
    """
    if given is None:
        return {}
    patterns = given if isinstance(given, Mapping) else {"*": given}
    values: dict[str, float] = {}
    for pattern, value in patterns.items():
        exact = [pattern] if pattern in joints else []  # brackets may be of a name
        fitting = exact or [joint for joint in joints if fnmatchcase(joint, str(pattern))]
        if not fitting:
            raise UnknownOptionError(f"joint in {what}", pattern, joints)
        check_positive(**{f"{what} of {pattern}": value})
        values |= dict.fromkeys(fitting, float(value))
    return values
