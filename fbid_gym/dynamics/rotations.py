"""Rotations of one robot, compiled; `frames` has them for whole batches."""

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.dynamics.vectors import Rotation, Vector, add, cross, dot, scale, transposed


@compiled
def rotation_at(quaternions: np.ndarray, i: int, first: int) -> Rotation:
    """Return the matrix of the quaternion quaternions[i, first : first + 4], w, x, y, z."""
    w, x = quaternions[i, first], quaternions[i, first + 1]
    y, z = quaternions[i, first + 2], quaternions[i, first + 3]
    double = 2.0 / (w * w + x * x + y * y + z * z)
    return (
        (1.0 - double * (y * y + z * z), double * (x * y - w * z), double * (x * z + w * y)),
        (double * (x * y + w * z), 1.0 - double * (x * x + z * z), double * (y * z - w * x)),
        (double * (x * z - w * y), double * (y * z + w * x), 1.0 - double * (x * x + y * y)),
    )


@compiled
def turn_quaternion(quaternions: np.ndarray, i: int, first: int, by: Vector) -> None:
    """Turn quaternions[i, first : first + 4] by a rotation vector (rad, world axes)."""
    angle = np.sqrt(dot(by, by))
    half = 0.5 * angle
    sine = 0.5 if angle < 1e-8 else np.sin(half) / angle
    w, (x, y, z) = np.cos(half), scale(sine, by)
    a, b = quaternions[i, first], quaternions[i, first + 1]
    c, d = quaternions[i, first + 2], quaternions[i, first + 3]
    e, f = w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c
    g, h = w * c - x * d + y * a + z * b, w * d + x * c - y * b + z * a
    size = np.sqrt(e * e + f * f + g * g + h * h)
    quaternions[i, first], quaternions[i, first + 1] = e / size, f / size
    quaternions[i, first + 2], quaternions[i, first + 3] = g / size, h / size


@compiled
def turned_left(target: Rotation, now: Rotation) -> Vector:
    """Return axis times sine of the rotation from `now` to `target`, world axes."""
    to, at = transposed(target), transposed(now)
    # 1/2 sum over columns of now × target.
    total = add(add(cross(at[0], to[0]), cross(at[1], to[1])), cross(at[2], to[2]))
    return scale(0.5, total)
