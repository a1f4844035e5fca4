"""Rotations of one robot, compiled; `frames` has them for whole batches."""

import numpy as np

from fbid_gym.compiled import compiled


@compiled
def rotation_of(quaternion: np.ndarray, result: np.ndarray) -> None:
    """Write to result (3, 3): the matrix of a quaternion (4,) w, x, y, z of any length but zero."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    double = 2.0 / (w * w + x * x + y * y + z * z)
    result[0, 0] = 1.0 - double * (y * y + z * z)
    result[0, 1] = double * (x * y - w * z)
    result[0, 2] = double * (x * z + w * y)
    result[1, 0] = double * (x * y + w * z)
    result[1, 1] = 1.0 - double * (x * x + z * z)
    result[1, 2] = double * (y * z - w * x)
    result[2, 0] = double * (x * z - w * y)
    result[2, 1] = double * (y * z + w * x)
    result[2, 2] = 1.0 - double * (x * x + y * y)


@compiled
def rotation_left(target: np.ndarray, now: np.ndarray) -> tuple[float, float, float]:
    """Return axis times sine of the rotation from `now` to `target`, both (3, 3), world axes."""
    x, y, z = 0.0, 0.0, 0.0
    # 1/2 sum over columns of now × target.
    for k in range(3):
        x += now[1, k] * target[2, k] - now[2, k] * target[1, k]
        y += now[2, k] * target[0, k] - now[0, k] * target[2, k]
        z += now[0, k] * target[1, k] - now[1, k] * target[0, k]
    return 0.5 * x, 0.5 * y, 0.5 * z
