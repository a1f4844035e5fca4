"""Actions and commands as they are given: checked before anything is lost."""

from typing import Any

import numpy as np

from fbid_gym.checks import check_finite, real_numbers
from fbid_gym.compiled import kernel
from fbid_gym.errors import InvalidValueError, ShapeError

_TOLERANCE = 1e-6


def finite_numbers(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return finite numbers of a shape as floats, or raise an FbidError."""
    found = real_numbers(name, value, f"numbers of shape {shape}").astype(float, copy=False)
    if found.shape != shape:
        raise ShapeError(name, found.shape, f"{shape}")
    check_finite(name, found)
    return found


def checked_action(action: Any, shape: tuple[int, ...], *, refuse: bool) -> np.ndarray:
    """Return actions of a shape as floats; `refuse` says whether one outside [-1, 1] is an error.

    Raises:
        ShapeError: they are of another shape.
        NonFiniteError: one is NaN or infinite.
        InvalidValueError: they are no numbers, or one is refused.
    """
    action = finite_numbers("action", action, shape)
    if refuse and (abs(action) > 1.0 + _TOLERANCE).any():
        where = tuple(int(i) for i in np.argwhere(abs(action) > 1.0 + _TOLERANCE)[0])
        expected = "a number in [-1, 1], or the argument actions='clip'"
        raise InvalidValueError(f"action at index {where}", float(action[where]), expected)
    return action


@kernel
def clip(action: np.ndarray) -> np.ndarray:
    """Clip actions (N, A) to [-1, 1], in place; return the shares (N,) of those that were not."""
    share = np.empty(len(action))
    for i in range(len(action)):
        beyond = 0
        for k in range(action.shape[1]):
            beyond += abs(action[i, k]) > 1.0 + _TOLERANCE
            action[i, k] = min(max(action[i, k], -1.0), 1.0)
        share[i] = beyond / action.shape[1]
    return share


def checked_command(
    command: Any, shape: tuple[int, ...], largest: float, num_envs: int
) -> np.ndarray:
    """Return a command for each environment, (num_envs, *shape), from one for all or one for each.

    Raises:
        FbidError: it is neither, or has numbers beyond the largest that can be observed.
    """
    expected = f"{shape}, or {(num_envs, *shape)} of environments' own"
    given = real_numbers("command", command, f"numbers of shape {expected}").astype(float)
    if given.shape not in (shape, (num_envs, *shape)):
        raise ShapeError("command", given.shape, expected)
    check_finite("command", given)
    if (abs(given) > largest).any():
        raise InvalidValueError("command", command, f"numbers from {-largest:g} to {largest:g}")
    return np.broadcast_to(given, (num_envs, *shape))
