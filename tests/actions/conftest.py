"""States for action layers: settled in stance, random, in flight."""

import numpy as np
import pytest

from tests.actions.cases import state_at


@pytest.fixture
def states(robot, rng):
    """(count, noise) -> (state, terms) near home and moving, all points loaded alike."""

    def make(count: int, noise: float = 0.1) -> tuple:
        qpos = np.tile(robot.home_qpos, (count, 1))
        qvel = noise * rng.normal(size=(count, robot.nv))
        qpos[:, 7:] += noise * rng.normal(size=(count, robot.num_joints))
        qpos[:, 3:7] += noise * rng.normal(size=(count, 4))
        qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
        qpos[:, :3] += rng.normal(size=(count, 3))
        return state_at(robot, qpos, qvel)

    return make
