from dataclasses import replace

import numpy as np
import pytest
import stand_in

from fbid_gym.errors import InvalidValueError
from fbid_gym.policy import Policy
from train.learner import build, export, normaliser, seeds
from train.runs.config import CrossQConfig, PPOConfig, SACConfig


@pytest.mark.parametrize(
    ("algorithm", "activation"),
    [
        *(("ppo", name) for name in ("tanh", "relu", "elu")),
        ("sac", "relu"),
        ("sac", "elu"),
        ("crossq", "relu"),
    ],
)
def test_exported_policy_is_the_prediction_of_stable_baselines3(tmp_path, algorithm, activation):
    often = {"gradient_steps": 4, "learning_starts": 64, "policy_starts": 0}
    own = {
        "ppo": PPOConfig(n_steps=16, batch_size=64, activation=activation, hidden=(20, 9)),
        "sac": SACConfig(n_steps=4, batch_size=32, activation=activation, hidden=(20, 9), **often),
        "crossq": CrossQConfig(n_steps=4, batch_size=32, hidden=(20, 9), **often),
    }
    config = stand_in.config(tmp_path, algorithm=algorithm, **{algorithm: own[algorithm]})
    learner = build(config, stand_in.make("", num_envs=8, seed=1, num_threads=1))
    # beyond the clip on both sides, and large enough for actions at their limits
    observation = np.random.default_rng(0).normal(scale=(1.0, 3.0, 100.0), size=(400, 3))
    observation = observation.astype(np.float32)
    if algorithm != "ppo":
        np.testing.assert_array_equal(export(learner, config, {})(observation), 0.0)
    learner.learn(512)
    stand_in.draw_network(learner)
    export(learner, config, {}).save(tmp_path / "policy")
    policy = Policy.load(tmp_path / "policy")
    output = "clip" if algorithm == "ppo" else "tanh"
    assert (policy.output, policy.algorithm, policy.trained_steps) == (output, algorithm, 512)
    expected, _ = learner.predict(
        normaliser(learner).normalize_obs(observation), deterministic=True
    )
    np.testing.assert_allclose(policy(observation), expected, atol=1e-6)
    assert np.ptp(expected) > 0.5 and (algorithm != "ppo" or (np.abs(expected) == 1.0).any())

    config = replace(config, start=str(tmp_path / "policy"))
    again = build(config, stand_in.make("", num_envs=8, seed=2, num_threads=1))
    np.testing.assert_array_equal(export(again, config, {})(observation), policy(observation))
    other = {**policy.env_args, "action_layer": "torque"}
    replace(policy, env_args=other, source="other").save(tmp_path / "policy")
    with pytest.raises(InvalidValueError, match="action_layer force; it has torque"):
        build(config, stand_in.make("", num_envs=8, seed=2, num_threads=1))


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
