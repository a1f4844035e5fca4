"""A symmetric policy answers a mirrored observation with the mirrored action."""

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
from train.learner import build, export, normaliser
from train.recipes import zoo
from train.runs.config import EvaluationConfig, PPOConfig, TrainConfig
from train.runs.differences import run_differences

ENV = "fbid_gym/QuadrupedWalk-v0"


def config(out: Path, layer: str = "joint_position", **changes) -> TrainConfig:
    own = {"n_steps": 8, "batch_size": 16, "hidden": (16, 8), "log_std_init": -1.0}
    given = {"env_args": {"episode_seconds": 0.5}, "total_steps": 64, "num_envs": 4}
    return TrainConfig(
        env=ENV,
        action_layer=layer,
        num_threads=1,
        torch_threads=1,
        out=out,
        eval=EvaluationConfig(every=32, episodes=2),
        ppo=PPOConfig(**own, learning_rate=0.01, symmetric=True),
        **{**given, **changes},
    )


@pytest.mark.parametrize(
    ("layer", "arguments"),
    [
        ("joint_position", {}),
        ("base_acceleration", {"observation": "body"}),
        ("joint_position", {"observation": "measured+estimate", "sensors": "mems"}),
    ],
)
def test_what_is_learnt_of_one_side_holds_for_the_other(tmp_path, layer, arguments, rng):
    given = config(tmp_path, layer, env_args={"episode_seconds": 0.5, **arguments})
    train.ppo.main(given)
    policy = Policy.load(tmp_path)
    envs = fbid_gym.make_sb3(ENV, 1, **given.make_args())
    mirror = mirrored(envs.chunks.batches[0])
    seen = rng.normal(size=(64, policy.observation_size))
    actions = policy(seen)
    assert np.abs(actions - mirror.action.of(actions)).max() > 1e-3  # it has learnt, and turns
    image = policy(mirror.observation.of(seen))
    np.testing.assert_allclose(image, mirror.action.of(actions), atol=1e-5)


def test_a_value_is_the_same_in_the_mirror_and_every_layer_as_lively_as_without(tmp_path, rng):
    given = config(tmp_path)
    learner, plain = (
        build(each, fbid_gym.make_sb3(ENV, 4, seed=0, **given.make_args()))
        for each in (given, replace(given, ppo=replace(given.ppo, symmetric=False)))
    )
    mirror = mirrored(normaliser(learner).venv.chunks.batches[0])
    seen = rng.normal(size=(256, len(mirror.observation.entry))).astype(np.float32)
    with torch.no_grad():
        one, other = (
            learner.policy.predict_values(torch.from_numpy(each.astype(np.float32)))
            for each in (seen, mirror.observation.of(seen))
        )
        spread = [each.policy.mlp_extractor.policy_net(torch.from_numpy(seen)).std().item()
                  for each in (learner, plain)]  # fmt: skip
    np.testing.assert_allclose(one, other, atol=1e-5)
    assert one.std() > 0.01
    assert spread[0] == pytest.approx(spread[1], rel=0.3)


def test_scales_are_those_of_both_sides_and_every_number_learns(tmp_path):
    given = config(tmp_path)
    learner = build(given, fbid_gym.make_sb3(ENV, 4, seed=0, **given.make_args()))
    mirror = mirrored(normaliser(learner).venv.chunks.batches[0])
    before = {name: value.clone() for name, value in learner.policy.named_parameters()}
    learner.learn(64)
    scales = normaliser(learner).obs_rms
    np.testing.assert_allclose(scales.mean, mirror.observation.of(scales.mean), atol=1e-6)
    np.testing.assert_allclose(scales.var, scales.var[mirror.observation.entry], rtol=1e-6)
    assert {id(x) for group in learner.policy.optimizer.param_groups for x in group["params"]} == {
        id(value) for value in learner.policy.parameters()
    }
    assert all(not torch.equal(value, before[name])
               for name, value in learner.policy.named_parameters())  # fmt: skip


def test_a_run_that_is_continued_is_the_same_run(tmp_path):
    straight, halved = config(tmp_path / "straight"), config(tmp_path / "halved", total_steps=32)
    train.ppo.main(straight)
    train.ppo.main(halved)
    train.ppo.main(replace(halved, total_steps=64))
    one, other = (Policy.load(given.folder) for given in (straight, halved))
    for name in ("mean", "variance"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for mine, its in zip(one.weights, other.weights, strict=True):
        np.testing.assert_array_equal(mine, its)


def test_it_begins_with_a_symmetric_policy_or_with_none(tmp_path):
    given = config(tmp_path / "symmetric")
    plain = replace(given, out=tmp_path / "plain", ppo=replace(given.ppo, symmetric=False))
    robots = fbid_gym.make_sb3(ENV, 4, seed=0, **given.make_args())
    for run in (given, plain):
        train.ppo.main(run)
    begun = export(build(replace(given, start=str(given.folder)), robots), given, {})
    for mine, its in zip(begun.weights, Policy.load(given.folder).weights, strict=True):
        np.testing.assert_allclose(mine, its, atol=1e-6)
    with pytest.raises(FbidError, match="Invalid start: .* Expected a symmetric policy"):
        build(replace(given, start=str(plain.folder)), robots)


def test_a_run_from_before_the_option_is_that_without_it(tmp_path):
    plain = config(tmp_path)
    stored = replace(plain, ppo=replace(plain.ppo, symmetric=False)).to_json()
    del stored["ppo"]["symmetric"]
    found = run_differences(stored, plain.to_json())
    assert [each.name for each in found] == ["ppo.symmetric"]


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (
            lambda out: replace(config(out), ppo=PPOConfig(symmetric=True, hidden=(16, 9))),
            r"Invalid ppo.hidden: \(16, 9\). Expected even widths",
        ),
        (lambda out: zoo.entry(config(out)), "Invalid ppo.symmetric: True. Expected false, for RL"),
        (
            lambda out: build(config(out, env_args={}), stand_in.PointMasses(4, 0)),
            "Invalid ppo.symmetric: True. Expected false in environments",
        ),
    ],
)
def test_what_cannot_be_symmetric_is_refused(tmp_path, make, complaint):
    with pytest.raises(FbidError, match=complaint):
        make(tmp_path)
