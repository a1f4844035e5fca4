"""Our vector environment against gymnasium's, made of our scalar environments."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import FbidError, InvalidValueError, ShapeError
from tests.batches import assert_same, begun
from tests.pairs import pairs

NUM_ENVS, BIPED = 4, next(iter(ENVIRONMENTS))
ARGUMENTS = {"action_layer": "torque", "episode_seconds": 0.44}


def thrown(rng, shape):
    """Torques that make the first half of the robots fall before their time is up."""
    action = np.zeros(shape, np.float32)
    action[: len(action) // 2] = rng.choice([-1.0, 1.0], size=shape[1:])
    return action


def both(name, mode):
    ours = gym.make_vec(name, num_envs=NUM_ENVS, autoreset_mode=mode.name, **ARGUMENTS)
    sync = {"vectorization_mode": "sync", "vector_kwargs": {"autoreset_mode": mode}}
    theirs = gym.make_vec(name, num_envs=NUM_ENVS, **sync, **ARGUMENTS)
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"] == mode
    return ours, theirs


def assert_same_info(ours, theirs):
    """Same entries where they are valid. A key that is valid nowhere may be missing in theirs."""
    for key, value in ours.items():
        if key.startswith("_"):
            continue
        valid = ours[f"_{key}"]
        if key not in theirs:
            assert not valid.any(), key
        elif isinstance(value, dict):
            np.testing.assert_array_equal(valid, theirs[f"_{key}"])
            assert_same_info(value, theirs[key])
        else:
            np.testing.assert_array_equal(valid, theirs[f"_{key}"], err_msg=key)
            for row in np.flatnonzero(valid):
                np.testing.assert_array_equal(value[row], theirs[key][row], err_msg=key)
    assert not theirs.keys() - ours.keys()


@pytest.mark.parametrize(("name", "mode"), pairs(list(ENVIRONMENTS)[:4], AutoresetMode, 1))
def test_like_gymnasiums_sync_vector_env(name, mode, rng):
    ours, theirs = both(name, mode)
    np.testing.assert_array_equal(ours.reset(seed=3)[0], theirs.reset(seed=3)[0])
    falls = cuts = 0
    for step in range(70):
        if step % 20 == 0:
            action = thrown(rng, ours.action_space.shape)
        one, other = ours.step(action), theirs.step(action)
        for value, expected in zip(one[:4], other[:4], strict=True):
            assert value.dtype == expected.dtype
            np.testing.assert_array_equal(value, expected)
        assert_same_info(one[4], other[4])
        terminated, truncated = one[2:4]
        falls, cuts = falls + terminated.sum(), cuts + truncated.sum()
        if mode == AutoresetMode.DISABLED and (terminated | truncated).any():
            mask = terminated | truncated
            resets = []
            for env in (ours, theirs):
                asked = {"reset_mask": mask.copy()}
                resets.append(env.reset(seed=[17, None, 19, None], options=asked)[0])
            np.testing.assert_array_equal(*resets)
            if mask.any():
                np.testing.assert_array_equal(resets[0][~mask], one[0][~mask])
    assert falls > 3 and cuts > 0
    ours.close()
    theirs.close()


def test_final_info_keeps_the_torque_of_the_last_step():
    """It is the torque that ended the episode, though the reset has forgotten it."""
    env = begun(BIPED, 2, autoreset_mode="SAME_STEP", **ARGUMENTS)
    action = np.full(env.action_space.shape, 0.3, np.float32)
    info = {}
    while "final_info" not in info:
        *_, info = env.step(action)
    ended = info["_final_info"]
    assert (np.abs(info["final_info"]["torque"][ended]).max(axis=1) > 1.0).all()


def test_seeds_in_every_form():
    env = gym.make_vec(BIPED, num_envs=3, action_layer="torque")
    counted = env.reset(seed=5)[0]
    np.testing.assert_array_equal(env.reset(seed=[5, 6, 7])[0], counted)
    for same in (np.int64(5), np.array([5, 6, 7]), (5, np.int64(6), np.uint8(7))):
        np.testing.assert_array_equal(env.reset(seed=same)[0], counted)
    following = env.reset()[0]
    assert (following != counted).any(axis=1).all()
    # None leaves an environment its generator.
    env.reset(seed=5)
    mixed = env.reset(seed=[8, None, 5])[0]
    np.testing.assert_array_equal(mixed[1], following[1])
    np.testing.assert_array_equal(mixed[2], counted[0])
    mask = np.array([False, True, False])
    partly = env.reset(seed=[1, 2, 3], options={"reset_mask": mask})[0]
    np.testing.assert_array_equal(partly[~mask], mixed[~mask])
    assert (partly[1] != mixed[1]).any()
    with pytest.raises(InvalidValueError, match=r"seed: \[1, 2\]. Expected one integer, or 3"):
        env.reset(seed=[1, 2])
    with pytest.raises(InvalidValueError, match=r"Invalid seed: 1.5"):
        env.reset(seed=1.5)
    with pytest.raises(InvalidValueError, match=r"Invalid seed: .*\[\[1\]\].*Expected one integer"):
        env.reset(seed=np.array([[1]]))
    with pytest.raises(ShapeError, match=r"reset_mask has shape \(2,\). Expected \(3,\) bool"):
        env.reset(options={"reset_mask": np.ones(2, bool)})
    with pytest.raises(ShapeError, match=r"reset_mask has shape \(3,\). Expected \(3,\) bool"):
        env.reset(options={"reset_mask": np.ones(3)})


@pytest.mark.parametrize("bad", [[8, -1, 5], [8, 5, 0.5], [8, True, 5], "123", {8, 5, 1}, -1])
def test_what_is_no_seed_seeds_nothing(bad):
    env = begun(BIPED, 3, 5, action_layer="torque")
    before = env.chunks.state_dict()
    with pytest.raises(InvalidValueError, match="Invalid seed.* Expected a whole number of at lea"):
        env.reset(seed=bad)
    assert_same(env.chunks.state_dict(), before)


def test_without_an_episode_there_is_no_step():
    alone = gym.make(BIPED, action_layer="torque").unwrapped
    with pytest.raises(FbidError, match=r"There is no episode to step: call reset\(\)"):
        alone.step(np.zeros(alone.action_space.shape))
    arguments = {"num_envs": 2, "action_layer": "torque", "episode_seconds": 0.1}
    env = gym.make_vec(BIPED, **arguments)
    with pytest.raises(FbidError, match=r"Environments \[0, 1\] have no episode .* call reset\(\)"):
        env.step(np.zeros(env.action_space.shape))
    for mode in ("SAME_STEP", "DISABLED"):
        env = gym.make_vec(BIPED, **arguments, autoreset_mode=mode)
        env.reset(seed=0, options={"reset_mask": np.array([True, False])})
        with pytest.raises(FbidError, match=r"Environments \[1\] have no episode"):
            env.step(np.zeros(env.action_space.shape))
    env.reset(seed=0)
    for _ in range(5):
        *_, truncated, _ = env.step(np.zeros(env.action_space.shape))
    assert truncated.all()
    with pytest.raises(FbidError, match=r"Environments \[0, 1\] have no episode"):
        env.step(np.zeros(env.action_space.shape))
