"""Names of actions on a body: each with what action 1 means."""

from collections.abc import Sequence

import numpy as np


def scaled_names(
    names: Sequence[str], scale: np.ndarray, linear: str, angular: str
) -> tuple[str, ...]:
    """Return the names of six components with their scales (6,) and units, linear ones first."""
    units = [linear] * 3 + [angular] * 3
    return tuple(
        f"{name} (x {size:.3g} {unit})"
        for name, size, unit in zip(names, scale, units, strict=True)
    )
