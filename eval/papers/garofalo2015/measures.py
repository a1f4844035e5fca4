"""Numbers drawn from what a blow did to a robot."""

from typing import Any

import numpy as np

from eval.papers.log import Log

IMPACT = 0.1
"""s after the pendulum is let go during which it may touch."""

SETTLED = 0.1
"""Share of its peak below which an error has settled."""


def settling_time(time: np.ndarray, error: np.ndarray) -> float:
    """Return how long after the first sample an error last exceeds a tenth of its peak, s.

    Args:
        time: (T,) s.
        error: (T,).
    """
    large = np.flatnonzero(np.abs(error) > SETTLED * np.abs(error).max())
    return float(time[large[-1]] - time[0])


def blow_numbers(log: Log, start: float, index: int = 0) -> dict[str, Any]:
    """Return peaks and settling times of one robot after a blow at `start` s, as JSON can hold it.

    Returns:
        com, rotation (3 each, m and rad): peaks of the errors; linear, angular (kg m/s,
        kg m^2/s): peaks of the momenta along their largest axis; com_settled, rotation_settled (s):
        of the largest axis; unrealised (2, N and N m): rms of what the momentum's rate lacks of
        the wrench that was wanted, after the blow; fell: s or None.
    """
    after = log.time >= start
    time = log.time[after]
    com, rotation = log["com"][after, index], log["rotation"][after, index]
    momentum = np.abs(log["momentum"][after, index])
    return {
        "com": np.abs(com).max(axis=0).tolist(),
        "rotation": np.abs(rotation).max(axis=0).tolist(),
        "linear": float(momentum[:, :3].max()),
        "angular": float(momentum[:, 3:].max()),
        "com_settled": settling_time(time, com[:, _largest(com)]),
        "rotation_settled": settling_time(time, rotation[:, _largest(rotation)]),
        "unrealised": unrealised(log, start + IMPACT, index),
        "fell": log.fall(index),
    }


def unrealised(log: Log, since: float, index: int = 0) -> list[float]:
    """Return rms force (N) and moment (N m) by which a momentum's rate missed the wanted wrench.

    The rate is a central difference of the logged momenta.
    """
    rate = np.gradient(log["momentum"][:, index].astype(float), log.time, axis=0)
    error = rate - log["desired"][:, index]
    # What carries the weight is in the wrench, but does not change the momentum.
    weight = log["desired"][0, index, 2]
    error[:, 2] += weight
    error = error[log.time >= since]
    return [float(np.sqrt(np.mean(np.sum(error[:, k] ** 2, axis=1)))) for k in _PARTS]


_PARTS = (slice(0, 3), slice(3, 6))


def _largest(error: np.ndarray) -> int:
    return int(np.abs(error).max(axis=0).argmax())
