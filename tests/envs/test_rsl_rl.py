"""The environment of rsl_rl, and that torchrl makes ours; where these are installed."""

import gymnasium as gym
import numpy as np
import pytest

import fbid_gym
from fbid_gym.errors import FbidError

BIPED = "fbid_gym/BipedBalance-v0"
ARGUMENTS = {"action_layer": "base_acceleration", "episode_seconds": 0.2}


def test_rsl_rl_sees_what_gymnasium_sees():
    torch = pytest.importorskip("torch")
    pytest.importorskip("rsl_rl", reason="pip install -c constraints.txt 'fbid_gym[clients]'")
    ours = fbid_gym.make_rsl_rl(BIPED, 3, seed=2, **ARGUMENTS)
    twin = gym.make_vec(BIPED, num_envs=3, autoreset_mode="SAME_STEP", **ARGUMENTS)
    first = twin.reset(seed=2)[0]
    np.testing.assert_array_equal(ours.get_observations()["policy"].numpy(), first)
    assert (ours.num_envs, ours.num_actions, ours.max_episode_length) == (3, 6, 10)
    rng = np.random.default_rng(0)
    for step in range(1, 25):
        assert ours.episode_length_buf.tolist() == [(step - 1) % 10] * 3
        action = rng.uniform(-2.0, 2.0, (3, 6)).astype(np.float32)
        seen, reward, done, extras = ours.step(torch.as_tensor(action))
        expected, value, terminated, truncated, info = twin.step(action)
        np.testing.assert_array_equal(seen["policy"].numpy(), expected)
        np.testing.assert_array_equal(reward.numpy(), value.astype(np.float32))
        np.testing.assert_array_equal(done.numpy(), terminated | truncated)
        np.testing.assert_array_equal(extras["time_outs"].numpy(), truncated)
        assert extras["log"]["/reward_height"] == pytest.approx(info["reward_height"].mean())
        assert extras["log"]["/clipped_actions"] > 0.0
    ours = fbid_gym.make_rsl_rl(BIPED, 3, seed=2, **ARGUMENTS)
    ours.episode_length_buf = torch.tensor([0, 7, 3])  # as init_at_random_ep_len does
    ends = {}
    for step in range(1, 14):
        for env in np.flatnonzero(ours.step(torch.zeros(3, 6))[2].numpy()):
            ends.setdefault(int(env), []).append(step)
    assert ends == {0: [10], 1: [3, 13], 2: [7]}


def test_without_rsl_rl_the_extra_is_named(monkeypatch):
    modules = __import__("sys").modules
    for name in ("rsl_rl", "rsl_rl.env"):
        monkeypatch.setitem(modules, name, None)
    monkeypatch.delitem(modules, "fbid_gym.envs.rsl_rl", raising=False)
    with pytest.raises(FbidError, match=r"make_rsl_rl needs rsl_rl.*'fbid_gym\[clients\]'"):
        _ = fbid_gym.make_rsl_rl


@pytest.mark.parametrize("mode", ["SAME_STEP", "DISABLED"])
def test_torchrl_makes_and_wraps_them(mode):
    envs = pytest.importorskip("torchrl.envs", reason="pip install 'fbid_gym[clients]'")
    alone = envs.GymEnv(BIPED, **ARGUMENTS)
    assert alone.rollout(4)["next", "reward"].shape == (4, 1)
    many = envs.GymWrapper(gym.make_vec(BIPED, num_envs=3, autoreset_mode=mode, **ARGUMENTS))
    rolled = many.rollout(12, break_when_any_done=False)
    assert rolled["next", "reward"].shape == (3, 12, 1)
    assert rolled["next", "truncated"].sum() == 3


def test_rsl_rl_has_the_groups_of_robots():
    pytest.importorskip("rsl_rl", reason="pip install -c constraints.txt 'fbid_gym[clients]'")
    envs = fbid_gym.make_rsl_rl(BIPED, 2, sensors="mems", observation="measured", **ARGUMENTS)
    columns = envs.envs.chunks.batches[0].observation_columns
    seen = envs.get_observations()
    for name in ("policy", "critic"):
        assert seen[name].shape[1] == columns[name].stop - columns[name].start
