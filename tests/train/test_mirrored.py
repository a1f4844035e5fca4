"""PPO with mirror images learns from both sides alike, and is continued exactly."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import stand_in
import torch

import fbid_gym
import train.ppo
from fbid_gym.envs.mirrored import mirrored
from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy
from train.learner import build
from train.runs.config import EvaluationConfig, TrainConfig

ENV = "fbid_gym/QuadrupedBalance-v0"


def config(out: Path, total_steps: int = 64) -> TrainConfig:
    small = TrainConfig(
        env=ENV,
        action_layer="joint_position",
        env_args={"episode_seconds": 0.5},
        total_steps=total_steps,
        num_envs=4,
        num_threads=1,
        torch_threads=1,
        out=out,
        eval=EvaluationConfig(every=32, episodes=2),
    )
    return replace(small, ppo=replace(small.ppo, n_steps=8, batch_size=16, mirror=True))


def test_minibatches_hold_every_sample_and_its_mirror_image(tmp_path, monkeypatch):
    given = config(tmp_path)
    envs = fbid_gym.make_sb3(ENV, 4, seed=0, **given.make_args())
    mirror = mirrored(envs.chunks.batches[0])
    learner = build(given, envs)
    statistics = learner.get_vec_normalize_env().obs_rms
    torch.nn.init.normal_(learner.policy.action_net.weight)
    monkeypatch.setattr(learner, "train", lambda: None)
    learner.learn(32)
    expected = mirror.observation.of(statistics.mean)
    np.testing.assert_allclose(statistics.mean, expected, atol=1e-12)
    np.testing.assert_allclose(statistics.var, statistics.var[mirror.observation.entry])
    for samples in learner.rollout_buffer.get(16):
        half = len(samples.actions) // 2
        assert half == 16
        with torch.no_grad():
            known = learner.policy.evaluate_actions(samples.observations, samples.actions)[1]
        torch.testing.assert_close(samples.old_log_prob, known)
        for name in ("old_values", "advantages", "returns"):
            assert torch.equal(*getattr(samples, name).split(half))
        for name, reflection in (("observations", mirror[0]), ("actions", mirror[1])):
            one, other = getattr(samples, name).numpy().reshape(2, half, -1)
            np.testing.assert_array_equal(other, reflection.of(one).astype(np.float32))


def test_a_run_that_is_continued_is_the_same_run(tmp_path):
    straight, halved = config(tmp_path / "straight"), config(tmp_path / "halved", 32)
    train.ppo.main(straight)
    train.ppo.main(halved)
    train.ppo.main(replace(halved, total_steps=64))
    one, other = (Policy.load(given.folder) for given in (straight, halved))
    for name in ("mean", "variance"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for mine, its in zip(one.weights, other.weights, strict=True):
        np.testing.assert_array_equal(mine, its)


def test_environments_of_others_have_no_mirror(tmp_path):
    given = replace(config(tmp_path), env_args={})
    with pytest.raises(FbidError, match="Invalid ppo.mirror: True. Expected false in environments"):
        build(given, stand_in.PointMasses(4, 0))
