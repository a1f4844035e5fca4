"""Same seed, same numbers: alone, in a batch of any size, on any number of threads."""

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.robots import load
from tests.batches import begun
from tests.envs.cases import CASES
from tests.pairs import pairs
from tests.postures import turned


def actions(env, steps, size=0.6, seed=0):
    rng = np.random.default_rng(seed)
    shape = env.action_space.shape
    return [rng.uniform(-size, size, shape).astype(np.float32) for _ in range(steps)]


@pytest.mark.parametrize(("name", "arguments"), CASES)
def test_a_batch_is_its_scalar_environments(name, arguments):
    """Bit for bit, on several threads, across ends of episodes: no row sees the others."""
    num_envs = 3
    batch = gym.make_vec(name, num_envs=num_envs, num_threads=2, **arguments)
    alone = [gym.make(name, **arguments) for _ in range(num_envs)]
    observation, _ = batch.reset(seed=11)
    for index, env in enumerate(alone):
        np.testing.assert_array_equal(env.reset(seed=11 + index)[0], observation[index])
    done, ends = np.zeros(num_envs, bool), 0
    for action in actions(batch, 20):
        observation, reward, terminated, truncated, info = batch.step(action)
        for index, env in enumerate(alone):
            if done[index]:
                np.testing.assert_array_equal(env.reset()[0], observation[index])
                continue
            seen, value, ended, cut, extra = env.step(action[index])
            np.testing.assert_array_equal(seen, observation[index])
            assert (value, ended, cut) == (reward[index], terminated[index], truncated[index])
            for key, entry in extra.items():
                np.testing.assert_array_equal(entry, info[key][index], err_msg=key)
        done = terminated | truncated
        ends += done.sum()
    assert ends >= num_envs


def turned_state(state, heading):
    """The state of environments turned about the world's vertical, with the pushes to come."""
    result = {name: value.copy() for name, value in state.items()}
    result["simulation.qpos"], rotation = turned(state["simulation.qpos"], heading)
    own = [f"simulation.{name}" for name in ("qvel", "qacc_warmstart", "contact_force")]
    for name in (*own, "plan.push_force"):
        result[name][..., :3] = state[name][..., :3] @ rotation.T
    return result


# A gait remembers places in the world, which are not turned here: its own tests turn it.
@pytest.mark.parametrize(
    ("name", "layer"),
    pairs(
        (n for n, a in ENVIRONMENTS.items() if "terrain" not in a and a["task"] != "walk"), LAYERS
    ),
)
def test_heading_does_not_matter(name, layer):
    """Turned robots pushed from turned sides see and earn the same.

    Not to the bit, because a turned state rounds differently. And not from the first step: there a
    foot touches the ground exactly, and rounding decides whether it does.
    """
    push = 0.1 * load(ENVIRONMENTS[name]["robot"]).weight
    arguments = {"action_layer": layer, "push_interval": (0.15, 0.25), "push_force": (push, push)}
    straight, turned = (begun(name, 4, 2, **arguments) for _ in range(2))
    for _ in range(4):
        straight.step(np.zeros(straight.action_space.shape))
    turned.chunks.load_state_dict(turned_state(straight.chunks.state_dict(), 2.4))
    pushed = np.zeros(4, bool)
    for action in actions(straight, 10, size=0.2):
        ours, theirs = straight.step(action), turned.step(action)
        np.testing.assert_allclose(ours[0], theirs[0], atol=1e-5)
        np.testing.assert_allclose(ours[1], theirs[1], atol=1e-5)
        pushed |= ours[4]["push"].any(axis=1)
        # By the same sizes, from other sides.
        sizes = (np.linalg.norm(info["push"], axis=1) for info in (ours[4], theirs[4]))
        np.testing.assert_allclose(*sizes)
        other = (ours[4]["push"] != theirs[4]["push"]).any(axis=1)
        np.testing.assert_array_equal(other, ours[4]["push"].any(axis=1))
    assert pushed.any()
