"""No robot's size is known to anything: similar robots do the same, each in its own time."""

import numpy as np
import pytest

from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.env_batch import EnvBatch
from tests.robots.similar import similar

CASES = [
    ("go1", "QuadrupedBalance", "height_interval"),
    ("go1", "QuadrupedWalk", "command_interval"),
    ("biped", "BipedBalance", "height_interval"),
    ("biped", "BipedWalk", "command_interval"),
]
STEPS = 4


def rollout(name: str, size: float, env: str, commands: str, layer: str) -> list[np.ndarray]:
    """Postures, torques and rewards of two robots, in units of those of size 1."""
    base, time = ENVIRONMENTS[f"fbid_gym/{env}-v0"], np.sqrt(size)
    robot = similar(name, size)
    rates = {"physics_hz": 1000, "control_hz": 500, "policy_hz": 50}
    own = {
        "robot": robot,
        "action_layer": layer,
        **{rate: round(base.get(rate, default) / time) for rate, default in rates.items()},
        "velocity_noise": 0.0,
        "episode_seconds": 4.0 * time,
        "push_force": (0.3 * robot.weight, 0.3 * robot.weight),
        "push_interval": (0.04 * time, 0.06 * time),
        "push_duration": 0.02 * time,
        commands: (2.0 * time, 4.0 * time),
    }
    batch = EnvBatch(EnvConfig.of(base | own), 2)
    for env_id in range(2):
        batch.seed(env_id, np.random.default_rng(env_id))
    batch.reset(np.arange(2))
    rng, seen = np.random.default_rng(7), []
    for _ in range(STEPS):
        step = batch.step(rng.uniform(-0.2, 0.2, (2, len(batch.action_names))))
        qpos = batch.simulation.qpos.copy()
        qpos[:, :3] /= size
        torque = step.info["torque_rms"] / robot.torque_limit.mean()
        seen.append((qpos, torque[:, None], step.reward[:, None]))
    return [np.array(values) for values in zip(*seen, strict=True)]


@pytest.mark.parametrize("layer", LAYERS)
@pytest.mark.parametrize(("name", "env", "commands"), CASES)
def test_size_is_unknown(name, env, commands, layer):
    own = rollout(name, 1.0, env, commands, layer)
    for size in (0.25, 4.0):
        other = rollout(name, size, env, commands, layer)
        for expected, value in zip(own, other, strict=True):
            np.testing.assert_allclose(value, expected, rtol=2e-4, atol=2e-4)
