"""Every registered environment, through some action layer: the interfaces and their promises."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_sb3_env

from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from tests.batches import begun
from tests.pairs import pairs

every_env = pytest.mark.parametrize(("name", "layer"), pairs(ENVIRONMENTS, LAYERS, 1))


@every_env
def test_gymnasium_and_sb3_find_nothing_to_complain_about(name, layer):
    # Warnings are errors here.
    env = gym.make(name, action_layer=layer)
    check_env(env.unwrapped, skip_render_check=True)
    check_sb3_env(env, warn=True)
    env.close()


@pytest.mark.parametrize(
    ("name", "layer", "size"), pairs(pairs(ENVIRONMENTS, LAYERS, 1), [0.0, 1.0], 1)
)
def test_what_every_step_promises(name, layer, size):
    env = gym.make_vec(name, num_envs=4, action_layer=layer, episode_seconds=0.7)
    robot = env.chunks.batches[0].robot
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    rng = np.random.default_rng(0)
    done, ended = np.zeros(4, bool), 0
    for _ in range(50):
        action = rng.uniform(-size, size, env.action_space.shape).astype(np.float32)
        observation, reward, terminated, truncated, info = env.step(action)
        live = ~done
        assert env.observation_space.contains(observation)
        assert ((reward >= 0.0) & (reward <= 1.0)).all()
        terms = sum(value for key, value in info.items() if key.startswith("reward_"))
        np.testing.assert_allclose(reward[live], terms[live], atol=1e-12)
        assert (reward[done] == 0.0).all()
        assert (np.abs(info["torque"]) <= robot.torque_limit * (1 + 1e-12)).all()
        for key in ("height", "height_command", "height_error", "torque_rms", "power", "slip"):
            assert info[key].shape == (4,) and np.isfinite(info[key]).all(), key
        assert (info["torque_rms"] <= robot.torque_limit.max()).all()
        assert (info["layer_saturation"] >= 0).all() and (info["layer_saturation"] <= 1).all()
        for diagnostic in env.chunks.batches[0].layer.diagnostics:
            assert np.isfinite(info[f"layer_{diagnostic}"]).all()
        assert info["contact_force"].shape == (4, robot.num_points, 3)
        assert info["push"].shape == (4, 3)
        np.testing.assert_array_equal(terminated, (info["termination"] == 1) & live)
        assert not (terminated & truncated).any()
        # The observation holds the last torque, not the last action.
        torques = ["last torque" in entry for entry in env.observation_names]
        seen = (info["torque"] / robot.torque_limit).astype(np.float32)
        np.testing.assert_array_equal(observation[live][:, torques], seen[live])
        done = terminated | truncated
        ended += done.sum()
    assert ended >= 4
    assert len(env.observation_names) == observation.shape[1]
    env.close()


# The torque layer's zero action is a constant torque: an inverted pendulum without feedback. It
# falls after about its natural time, sqrt(height / g), times the logarithm of how far it may go.
STANDS = {"torque": 0.4}


def stands(name, layer):
    """Whether a layer without a policy can be expected to stay up in an environment."""
    task = ENVIRONMENTS[name]["task"]
    if task == "balance":
        return True
    if task == "walk":  # joints that follow their own do not balance on soles at 250 Hz
        joints = layer in ("joint_position", "joint_acceleration")
        return layer not in STANDS and ("Quadruped" in name or not joints)
    # Weight that shifts from foot to foot takes a model.
    kinematic = layer in ("joint_position", "task_space_position")
    return layer not in STANDS and (not kinematic or task == "squat")


@pytest.mark.parametrize(
    ("name", "layer"), [row for row in pairs(ENVIRONMENTS, LAYERS, 2) if stands(*row)]
)
def test_the_zero_action_stands(name, layer):
    arguments = {"push_force": (0.0, 0.0)}
    if ENVIRONMENTS[name]["task"] == "balance":
        arguments["height_range"] = (1.0, 1.0)
    elif ENVIRONMENTS[name]["task"] == "walk":  # the command is to stand
        ranges = ("forward_range", "sideways_range", "turning_range")
        arguments |= dict.fromkeys(ranges, (0.0, 0.0))
        arguments["randomisation"] = None  # version 1 has loads, and slippery ground
    env = begun(name, 4, 1, action_layer=layer, **arguments)
    seconds = STANDS.get(layer, 2.0)
    for _ in range(round(seconds * 50)):
        _, reward, terminated, _, info = env.step(np.zeros(env.action_space.shape, np.float32))
        assert not terminated.any()
    if layer in STANDS:
        assert (info["height"] > 0.8 * info["height_command"]).all()
    else:
        np.testing.assert_allclose(info["height"], info["height_command"], rtol=0.05)
        assert (reward > 0.8).all()
    env.close()


@every_env
def test_the_observation_does_not_depend_on_the_layer(name, layer):
    envs = [gym.make(name, action_layer=own) for own in ("torque", layer)]
    np.testing.assert_array_equal(*(env.reset(seed=4)[0] for env in envs))
    assert envs[0].observation_space == envs[1].observation_space
