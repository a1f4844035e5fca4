"""The stable-baselines3 environment against gymnasium's same-step autoreset, and with PPO."""

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

import fbid_gym
from fbid_gym.envs import ENVIRONMENTS
from tests.pairs import pairs

BIPED, *_ = ENVIRONMENTS
ARGUMENTS = {"action_layer": "torque", "episode_seconds": 0.44}


@pytest.mark.parametrize(("name", "num_threads"), pairs(list(ENVIRONMENTS)[:4], [1, 2], 1))
def test_like_same_step_autoreset(name, num_threads, rng):
    envs = fbid_gym.make_sb3(name, 4, seed=3, num_threads=num_threads, **ARGUMENTS)
    twin = gym.make_vec(name, num_envs=4, autoreset_mode="SAME_STEP", **ARGUMENTS)
    np.testing.assert_array_equal(envs.reset(), twin.reset(seed=3)[0])
    returns, lengths, falls, cuts = np.zeros(4), np.zeros(4, int), 0, 0
    action = np.zeros((4, *envs.action_space.shape), np.float32)
    for step in range(70):
        if step % 20 == 0:  # the first two are thrown over, the others run out of time
            action[:2] = rng.choice([-1.0, 1.0], envs.action_space.shape)
        observation, reward, done, infos = envs.step(action)
        seen, value, terminated, truncated, info = twin.step(action)
        np.testing.assert_array_equal(observation, seen)
        np.testing.assert_array_equal(reward, value.astype(np.float32))
        np.testing.assert_array_equal(done, terminated | truncated)
        returns, lengths = returns + value, lengths + 1
        for env in range(4):
            numbers = {key for key, value in envs.last_info.items() if value.ndim == 1}
            assert numbers <= infos[env].keys() and "torque_rms" in numbers
            assert all(infos[env][key] == envs.last_info[key][env] for key in numbers)
            if not done[env]:
                assert infos[env].keys() == numbers
                continue
            last = infos[env]
            np.testing.assert_array_equal(last["terminal_observation"], info["final_obs"][env])
            assert last["TimeLimit.truncated"] is bool(truncated[env])
            assert last["episode"]["r"] == pytest.approx(returns[env])
            assert last["episode"]["l"] == lengths[env] <= 22
            assert (lengths[env] == 22) or not truncated[env]
            assert last["termination"] == (0 if truncated[env] else 1)
            np.testing.assert_array_equal(last["torque"], info["final_info"]["torque"][env])
            returns[env] = lengths[env] = 0
        for key, entry in envs.last_info.items():
            part = info[f"_{key}"]
            np.testing.assert_array_equal(entry[part], info[key][part], err_msg=key)
        falls, cuts = falls + terminated.sum(), cuts + truncated.sum()
    assert falls > 3 and cuts > 0
    envs.close()


def test_seeding():
    envs = fbid_gym.make_sb3(BIPED, 2, seed=5, action_layer="torque")
    first = envs.reset()
    assert (envs.reset() != first).any()
    envs.seed(5)
    np.testing.assert_array_equal(envs.reset(), first)
    alone = gym.make(BIPED, action_layer="torque")
    np.testing.assert_array_equal(alone.reset(seed=6)[0], first[1])
    unseeded = [fbid_gym.make_sb3(BIPED, 1, action_layer="torque").reset() for _ in range(2)]
    assert (unseeded[0] != unseeded[1]).any()


def test_ppo_learns_from_it():
    """A few steps of the real thing, with the wrappers that one puts around it."""
    envs = fbid_gym.make_sb3(BIPED, 4, seed=0, action_layer="joint_position", episode_seconds=0.4)
    envs = VecNormalize(envs, norm_reward=False)
    model = PPO("MlpPolicy", envs, n_steps=32, batch_size=64, n_epochs=1, seed=0, device="cpu")
    before = [p.detach().clone() for p in model.policy.parameters()]
    model.learn(256)
    assert model.num_timesteps == 256
    after = list(model.policy.parameters())
    assert any((p != q).any() for p, q in zip(before, after, strict=True))
    assert len(model.ep_info_buffer) >= 8
    assert all(1 <= episode["l"] <= 20 for episode in model.ep_info_buffer)
    envs.close()


def test_staggered_environments_begin_and_end_apart():
    """Their first episodes are cut, evenly spread; until then they are what they are otherwise."""
    arguments = {"seed": 1, "action_layer": "base_acceleration", "episode_seconds": 0.24}
    envs = fbid_gym.make_sb3(BIPED, 5, stagger=True, **arguments)
    twin = fbid_gym.make_sb3(BIPED, 5, **arguments)
    np.testing.assert_array_equal(envs.reset(), twin.reset())
    action = np.zeros((5, *envs.action_space.shape), np.float32)
    ends = {env: [] for env in range(5)}
    for step in range(1, 30):
        if step == 4:  # an exact state remembers what is still to be cut
            kept = envs.state_dict()
            envs.step(action)
            envs.load_state_dict(kept)
        observation, reward, done, infos = envs.step(action)
        seen, value, _, _ = twin.step(action)
        for env in np.flatnonzero(done):
            ends[env].append(step)
            assert infos[env]["TimeLimit.truncated"] and infos[env]["termination"] == 0
            whole = len(ends[env]) > 1 or step == 12
            assert infos[env].get("episode", {"l": None})["l"] == (12 if whole else None)
        first = [env for env in range(5) if not ends[env]]
        np.testing.assert_array_equal(observation[first], seen[first])
        np.testing.assert_array_equal(reward[first], value[first])
    assert ends == {0: [3, 15, 27], 1: [5, 17, 29], 2: [8, 20], 3: [10, 22], 4: [12, 24]}
    envs.reset()
    assert [np.flatnonzero(envs.step(action)[2]).tolist() for _ in range(3)] == [[], [], [0]]
    envs.close()
    twin.close()


def test_a_fall_is_reported_whenever_it_happens():
    envs = fbid_gym.make_sb3(BIPED, 8, seed=0, stagger=True, action_layer="torque")
    envs.reset()
    action = np.ones((8, *envs.action_space.shape), np.float32)
    fell = set()
    while len(fell) < 8:
        _, _, done, infos = envs.step(action)
        for env in np.flatnonzero(done):
            if infos[env]["termination"] == 1:
                fell.add(env)
                assert "episode" in infos[env] and not infos[env]["TimeLimit.truncated"]
    envs.close()
