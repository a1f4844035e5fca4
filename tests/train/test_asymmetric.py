"""PPO whose actor sees what a robot can, and whose critic sees the truth."""

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import stand_in
import torch

import fbid_gym
import train.ppo
from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy
from train.learner import build, export

ENV = "fbid_gym/QuadrupedBalance-v0"
ROBOT = {"sensors": "mems", "observation": "measured", "history": 2, "episode_seconds": 0.5}


def test_actor_and_critic_see_their_own_parts(tmp_path: Path) -> None:
    given = stand_in.tiny(tmp_path, env_args=ROBOT)
    learner = build(given, fbid_gym.make_sb3(ENV, 4, seed=0, **given.make_args()))
    learner.env.reset()
    size = export(learner, given, {}).observation_size
    whole = learner.observation_space.shape[0]
    assert 0 < size < whole
    seen = torch.randn(5, whole)
    other = seen.clone()
    other[:, size:] += 1.0  # all that is the critic's
    with torch.no_grad():
        assert torch.equal(*(learner.policy.get_distribution(x).mode() for x in (seen, other)))
        assert not torch.equal(*(learner.policy.predict_values(x) for x in (seen, other)))
        other = seen.clone()
        other[:, :size] += 1.0
        assert torch.equal(*(learner.policy.predict_values(x) for x in (seen, other)))


def test_a_run_exports_the_actor_alone(tmp_path: Path) -> None:
    given = stand_in.tiny(tmp_path / "run", env_args=ROBOT)
    train.ppo.main(given)
    policy = Policy.load(tmp_path / "run")
    env = gym.make(policy.env_id, **policy.env_args)
    observation, _ = env.reset(seed=0)
    own = env.unwrapped.batch.observation_columns["policy"]
    assert policy.observation_size == own.stop < len(observation)
    action = policy(observation[None])
    np.testing.assert_array_equal(action, policy(observation[None, own]))
    policy.check(observation_size=len(observation))


@pytest.mark.slow
def test_killed_and_resumed_is_the_same_run(tmp_path: Path) -> None:
    changes = {"env": ENV, "action_layer": "joint_position", "env_args": ROBOT, "num_threads": 1}
    stand_in.train_and_die(tmp_path / "a", 16 * 3 + 5, real=True, **changes)
    for name in "ab":
        train.ppo.main(stand_in.config(tmp_path / name, **changes))
    stand_in.assert_same_run(tmp_path / "b", tmp_path / "a")


def test_sac_is_refused(tmp_path: Path) -> None:
    changes = {"env": ENV, "action_layer": "joint_position", "env_args": ROBOT}
    given = stand_in.config(tmp_path, algorithm="sac", **changes)
    with pytest.raises(FbidError, match="observation for sac"):
        build(given, fbid_gym.make_sb3(ENV, 1, **given.make_args()))
