"""The compiled rotations are those of `frames`."""

import numpy as np

from fbid_gym.compiled import kernel
from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.dynamics.rotations import rotation_at
from fbid_gym.dynamics.vectors import store


@kernel
def rotations(quaternion: np.ndarray, result: np.ndarray) -> None:
    for i in range(len(quaternion)):
        rows = rotation_at(quaternion, i, 0)
        for axis in range(3):
            store(rows[axis], result, (i, axis))


def test_matrices_of_quaternions_of_any_length(rng):
    quaternion, found = rng.normal(size=(50, 4)), np.empty((50, 3, 3))
    rotations(quaternion, found)
    np.testing.assert_allclose(found, quaternion_to_matrix(quaternion), atol=1e-14)
