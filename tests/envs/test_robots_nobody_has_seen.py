"""Robots of the zoo stand by a zero action: legs that cannot turn their soles every way."""

import numpy as np
import pytest

from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.robots import Robot
from tests.robots import zoo

# On soles with five joints a leg, two, four and six of them, 1.3 to 4.4 kg: closed chains that can
# hardly move in some directions, and not at all in others.
SEEDS = (2, 20, 29, 32)


@pytest.mark.parametrize("layer", ["base_acceleration", "joint_acceleration"])
@pytest.mark.parametrize("seed", SEEDS)
def test_it_stands(seed, layer):
    animal = zoo.draw(seed)
    limit = zoo.torque_limit(animal) if animal.actuators == "none" else None
    robot = Robot.from_mjcf(zoo.mjcf(animal), animal.foot_names, torque_limit=limit)
    config = {"robot": robot, "task": "balance", "action_layer": layer, "push_force": (0.0, 0.0)}
    batch = EnvBatch(EnvConfig.of(config), 4)
    for env in range(4):
        batch.seed(env, np.random.default_rng(env))
    batch.reset(np.arange(4))
    zero = np.zeros((4, len(batch.action_names)))
    for _ in range(5 * batch.rates.policy):
        step = batch.step(zero)
        assert not step.terminated.any()
    assert step.info["layer_residual"].max() < 1e-3
