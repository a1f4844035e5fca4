"""Actions as they are given: checked before anything is lost."""

import numpy as np

from fbid_gym.checks import real_numbers
from fbid_gym.compiled import kernel
from fbid_gym.errors import InvalidValueError, NonFiniteError, ShapeError

_TOLERANCE = 1e-6


def checked_action(action: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return actions of a shape as floats.

    Raises:
        ShapeError: they are of another shape.
        NonFiniteError: one is NaN or infinite.
        InvalidValueError: they are no numbers, or one is outside of [-1, 1].
    """
    action = real_numbers("action", action, f"numbers of shape {shape}").astype(float, copy=False)
    if action.shape != shape:
        raise ShapeError("action", action.shape, f"{shape}")
    if not _within(np.ascontiguousarray(action).reshape(-1), 1.0 + _TOLERANCE):
        bad = ~(np.abs(action) <= 1.0 + _TOLERANCE)
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        if not np.isfinite(action[where]):
            raise NonFiniteError("action", where)
        raise InvalidValueError(
            f"action at index {where}", float(action[where]), "a number in [-1, 1]"
        )
    return action


@kernel
def _within(values: np.ndarray, most: float) -> bool:
    """Whether all of (K,) are numbers of at most this size."""
    for value in values:
        if not abs(value) <= most:
            return False
    return True
