import numpy as np
import pytest
import stand_in

from train.learner import build, export, normaliser, seeds
from train.runs.config import PPOConfig


@pytest.mark.parametrize("activation", ["tanh", "relu", "elu"])
def test_exported_policy_is_the_prediction_of_stable_baselines3(tmp_path, activation):
    config = stand_in.config(
        tmp_path, ppo=PPOConfig(n_steps=16, batch_size=64, activation=activation, hidden=(20, 9))
    )
    learner = build(config, stand_in.make("", num_envs=8, seed=1, num_threads=1))
    learner.learn(512)
    stand_in.draw_network(learner)
    policy = export(learner, config, {})
    assert policy.trained_steps == 512
    # beyond the clip on both sides, and large enough for actions at their limits
    observation = np.random.default_rng(0).normal(scale=(1.0, 3.0, 100.0), size=(400, 3))
    observation = observation.astype(np.float32)
    expected, _ = learner.predict(
        normaliser(learner).normalize_obs(observation), deterministic=True
    )
    np.testing.assert_allclose(policy(observation), expected, atol=1e-6)
    assert np.ptp(expected) > 0.5 and (np.abs(expected) == 1.0).any()


def test_seeds_of_neighbouring_runs_share_no_robot():
    robots = [set(range(s, s + 64)) for s in (seeds(k)["robots"] for k in range(50))]
    assert len(set.union(*robots)) == 50 * 64
    assert seeds(3) == seeds(3)
    assert seeds(3)["robots"] != seeds(3)["learner"]


@pytest.mark.parametrize("end", [None, 0.0, 2e-3])
def test_the_learning_rate_falls_to_its_end(tmp_path, end):
    ppo = PPOConfig(n_steps=16, batch_size=64, learning_rate=1e-3, learning_rate_end=end)
    config = stand_in.config(tmp_path, ppo=ppo)
    learner = build(config, stand_in.make("", num_envs=8, seed=1, num_threads=1))
    last = 1e-3 if end is None else end
    rates = [learner.lr_schedule(left) for left in (1.0, 0.5, 0.0, -0.1)]
    np.testing.assert_allclose(rates, [1e-3, (1e-3 + last) / 2, last, last], atol=1e-12)
