"""What others' programs rely on: errors of Python's, specs, copies, commands, limits of time."""

import copy
import json
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import TimeAwareObservation

import fbid_gym
from fbid_gym.actions.ranges import Falling
from fbid_gym.envs import ENTRY_POINT
from fbid_gym.errors import (
    FbidError,
    InvalidValueError,
    NonFiniteError,
    ShapeError,
    UnknownArgumentError,
    UnknownOptionError,
)
from fbid_gym.robots import Robot, load
from fbid_gym.robots.built_in import QUADRUPED, asset_path
from tests.batches import assert_same, begun

BIPED, WALK = "fbid_gym/BipedBalance-v0", "fbid_gym/QuadrupedWalk-v0"
TORQUE = {"action_layer": "torque"}


@pytest.mark.parametrize(
    "error",
    [
        UnknownOptionError("robot", "horse", ["go1"]),
        UnknownArgumentError("The environment", "frameskip", ["robot"]),
        InvalidValueError("friction", -1, "a number from 0 to 10"),
        ShapeError("action", (3,), "(6,)"),
        NonFiniteError("action", (2,)),
    ],
)
def test_errors_are_pythons_and_can_be_raised_anew(error):
    assert isinstance(error, ValueError) and isinstance(error, FbidError)
    again = type(error)(f"{error} was raised from somewhere")
    assert str(again) == f"{error} was raised from somewhere"
    sent = pickle.loads(pickle.dumps(error))
    assert str(sent) == str(error) and vars(sent) == vars(error)


def test_unknown_keywords_are_type_errors_in_pythons_words():
    for make in (gym.make, gym.make_vec, fbid_gym.make_sb3):
        with pytest.raises(TypeError, match="got an unexpected keyword argument 'frameskip'"):
            make(BIPED, frameskip=1)


def test_actions_are_clipped_and_their_share_is_told():
    ours, clipped = (begun(BIPED, 3, action_layer="base_acceleration") for _ in range(2))
    rng = np.random.default_rng(0)
    for _ in range(5):
        action = rng.normal(0.0, 1.5, ours.action_space.shape)
        kept = action.copy()
        one, other = ours.step(action), clipped.step(np.clip(action, -1.0, 1.0))
        np.testing.assert_array_equal(action, kept)  # whose they are
        for value, expected in zip(one[:4], other[:4], strict=True):
            np.testing.assert_array_equal(value, expected)
        share = (abs(action) > 1.0).mean(axis=1)
        np.testing.assert_allclose(one[4]["clipped_actions"], share, rtol=1e-15)
        assert not other[4]["clipped_actions"].any()
    alone = begun(BIPED, action_layer="base_acceleration")
    info = alone.step(np.array([9.0, -9.0, 0.0, 0.5, 1.0, 1.5]))[4]
    assert info["clipped_actions"] == pytest.approx(0.5)
    sb3 = fbid_gym.make_sb3(BIPED, 2, action_layer="base_acceleration")
    sb3.reset()
    assert sb3.step(np.full((2, 6), 3.0))[3][1]["clipped_actions"] == 1.0


def test_actions_are_refused_where_that_is_asked_for():
    envs = begun(BIPED, 2, **TORQUE, actions="refuse")
    envs.step(np.ones((2, 16)) + 5e-7)  # rounding is forgiven
    before, bad = envs.chunks.state_dict(), np.zeros((2, 16))
    bad[1, 3] = -1.01
    with pytest.raises(InvalidValueError, match=r"action at index \(1, 3\): -1.01. Expected a num"):
        envs.step(bad)
    assert_same(envs.chunks.state_dict(), before)


@pytest.mark.parametrize("env_id", [BIPED, WALK])
def test_info_holds_numbers_alone(env_id):
    env = gym.make(env_id, **TORQUE)
    assert env.metadata["terminations"] == ("", "fall", "diverged")
    env.reset(seed=0)
    terminated = False
    while not terminated:
        *_, terminated, _, info = env.step(np.ones(env.action_space.shape))
        assert all(np.asarray(value).dtype.kind in "fib" for value in info.values())
        assert info["termination"] == terminated


def test_the_spec_knows_how_long_an_episode_is():
    assert gym.make(BIPED).spec.max_episode_steps == 500
    assert gym.make(WALK).spec.max_episode_steps == 1000
    assert gym.make(WALK, episode_seconds=3.0).spec.max_episode_steps == 150
    assert gym.make(WALK, max_episode_steps=30).spec.max_episode_steps == 30
    envs = gym.make_vec(WALK, num_envs=2, max_episode_steps=30)
    assert envs.spec.max_episode_steps == 30
    assert gym.make_vec(WALK, num_envs=2).spec.max_episode_steps == 1000
    timed = TimeAwareObservation(gym.make(BIPED, **TORQUE), normalize_time=True)
    timed.reset(seed=0)
    assert timed.step(np.zeros(16))[0][-1] == pytest.approx(1 / 500)


def test_episodes_end_after_so_many_steps_as_those_of_gymnasium():
    arguments = {"action_layer": "base_acceleration", "max_episode_steps": 7}
    ours = gym.make_vec(BIPED, num_envs=2, **arguments)
    theirs = gym.make_vec(BIPED, num_envs=2, vectorization_mode="sync", **arguments)
    ours.reset(seed=0), theirs.reset(seed=0)
    sb3 = fbid_gym.make_sb3(BIPED, 2, seed=0, **arguments)
    sb3.reset()
    ends = []
    for step in range(1, 20):
        one, other = (env.step(np.zeros((2, 6))) for env in (ours, theirs))
        for value, expected in zip(one[:4], other[:4], strict=True):
            np.testing.assert_array_equal(value, expected)
        _, _, done, infos = sb3.step(np.zeros((2, 6)))
        if done.all():
            ends.append(step)
            assert infos[0]["TimeLimit.truncated"] and infos[0]["episode"]["l"] == 7
    assert ends == [7, 14]
    with pytest.raises(FbidError, match="Invalid max_episode_steps: 0. Expected a whole number"):
        gym.make_vec(BIPED, num_envs=2, max_episode_steps=0)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_are_made_as_the_original(copied):
    arguments = {"num_envs": 3, "stagger": True, "max_episode_steps": 6, "num_threads": 2}
    envs = gym.make_vec(WALK, autoreset_mode="SAME_STEP", joint_noise=np.float32(0.1), **arguments)
    twin = copied(envs)
    assert twin.spec == envs.spec and twin.metadata == envs.metadata
    np.testing.assert_array_equal(twin.reset(seed=3)[0], envs.reset(seed=3)[0])
    for _ in range(8):
        action = np.full(envs.action_space.shape, 0.1)
        for value, expected in zip(twin.step(action)[:4], envs.step(action)[:4], strict=True):
            np.testing.assert_array_equal(value, expected)


def test_specs_are_json_with_robots_and_numbers_of_ones_own():
    robot = Robot.from_mjcf(asset_path(QUADRUPED.asset), QUADRUPED.feet, name="rex")
    given = {
        "robot": robot,
        "action_layer": "base_acceleration",
        "layer_options": {"height_frequency": Falling(1.5), "max_normal_force": np.inf},
        "push_force": np.array([1.0, 2.0]),
        "episode_seconds": np.float32(2.0),
    }
    for env in (gym.make(BIPED, **given), gym.make_vec(BIPED, num_envs=2, **given)):
        text = env.spec.to_json()
        written = json.loads(text)["kwargs"]
        assert written["robot"] == "rex" and written["push_force"] == [1.0, 2.0]
        assert env.spec.kwargs["robot"] is robot  # the spec itself makes it again
    first = gym.make(env.spec.id, **given).reset(seed=2)[0]
    spec = EnvSpec.from_json(gym.make(BIPED, **given).spec.to_json())
    np.testing.assert_array_equal(gym.make(spec, robot=robot).reset(seed=2)[0], first)
    with pytest.raises(UnknownOptionError, match="Unknown robot 'rex'"):
        gym.make(spec)


@pytest.mark.usefixtures("registries")
def test_ids_of_users_are_taken_everywhere():
    gym.register(mine := "mine/Walk-v0", ENTRY_POINT, max_episode_steps=9,
                 kwargs={"robot": "quadruped"},
                 vector_entry_point="fbid_gym.envs.vector_env:RobotVectorEnv")  # fmt: skip
    one, many, sb3 = gym.make(mine), gym.make_vec(mine, num_envs=2), fbid_gym.make_sb3(mine, 2)
    assert sb3.chunks.batches[0].robot is load("quadruped")
    assert one.spec.max_episode_steps == many.spec.max_episode_steps == 9
    assert sb3.get_attr("spec")[0].max_episode_steps == 9
    assert gym.make_vec(mine, num_envs=2, max_episode_steps=5).spec.max_episode_steps == 5


COMMAND = (0.2, -0.1, 0.1)


def seen_command(env, observation):
    return observation[..., env.get_wrapper_attr("batch").observation_columns["command"]]


def test_commands_from_outside():
    env = gym.make(WALK, action_layer="base_acceleration", command_interval=(0.1, 0.2))
    observation, _ = env.reset(seed=0, options={"command": COMMAND})
    np.testing.assert_allclose(seen_command(env, observation), COMMAND, rtol=1e-6)
    zero = np.zeros(env.action_space.shape)
    for _ in range(30):
        np.testing.assert_allclose(seen_command(env, env.step(zero)[0]), COMMAND, rtol=1e-6)
    env.unwrapped.set_command((-0.1, 0.0, 0.0))
    np.testing.assert_allclose(seen_command(env, env.step(zero)[0]), (-0.1, 0, 0), atol=1e-6)
    drawn = env.reset(seed=0)[0]
    assert abs(seen_command(env, drawn) - np.array(COMMAND)).max() > 0.01
    # A robot walks as it is told, whatever it was told before.
    for speed in (0.3, -0.2):
        env.reset(seed=0, options={"command": (speed, 0.0, 0.0)})
        speeds = []
        for _ in range(120):
            *_, info = env.step(zero)
            speeds.append(info["speed_command"])
        assert np.allclose(speeds, abs(speed)) and info["velocity_error"] < 0.2
    balance = gym.make(BIPED, action_layer="base_acceleration")
    balance.reset(seed=0, options={"command": 0.9})
    assert balance.step(np.zeros(6))[4]["height_command"] == pytest.approx(0.9)


def test_commands_of_many():
    envs = gym.make_vec(WALK, num_envs=3, num_threads=2, **TORQUE)
    batch = envs.chunks.batches[0]
    where = batch.observation_columns["command"]
    one = envs.reset(seed=0, options={"command": COMMAND})[0]
    np.testing.assert_allclose(one[:, where], [COMMAND] * 3, rtol=1e-6)
    each = np.arange(9.0).reshape(3, 3) / 10
    mask = np.array([True, False, True])
    some = envs.reset(options={"command": each, "reset_mask": mask})[0]
    np.testing.assert_allclose(some[mask][:, where], each[mask], rtol=1e-6)
    np.testing.assert_allclose(some[1, where], COMMAND, rtol=1e-6)
    envs.unwrapped.set_command(each)
    seen = envs.step(np.zeros(envs.action_space.shape))[0]
    np.testing.assert_allclose(seen[:, where], each, rtol=1e-6)
    sb3 = fbid_gym.make_sb3(WALK, 3, **TORQUE)
    sb3.set_options({"command": COMMAND})
    np.testing.assert_allclose(sb3.reset()[:, where], [COMMAND] * 3, rtol=1e-6)
    sb3.env_method("set_command", each)
    seen = sb3.step(np.zeros((3, *sb3.action_space.shape)))[0]
    np.testing.assert_allclose(seen[:, where], each, rtol=1e-6)
    assert abs(sb3.reset()[:, where] - COMMAND).max() > 0.01


@pytest.mark.parametrize(
    ("env_id", "command", "message"),
    [
        (WALK, (0.1, 0.2), r"command has shape \(2,\). Expected \(3,\), or \(2, 3\)"),
        (WALK, (0.1, np.nan, 0.0), "command is not finite"),
        (WALK, (99.0, 0.0, 0.0), r"Invalid command: \(99.0, .*numbers from -10 to 10"),
        (WALK, "fast", "Invalid command: 'fast'"),
        ("fbid_gym/BipedSquat-v0", 1.0, "Invalid command: 1.0. Expected none in task 'squat'"),
    ],
)
def test_bad_commands_change_nothing(env_id, command, message):
    envs = begun(env_id, 2, **TORQUE)
    before = envs.chunks.state_dict()
    for give in (
        lambda: envs.reset(seed=1, options={"command": command}),
        lambda: envs.set_command(command),
    ):
        with pytest.raises(FbidError, match=message):
            give()
        assert_same(envs.chunks.state_dict(), before)


def test_a_curriculum_of_commands():
    """Those of level k are k tenths of what is drawn; who follows them goes up, who falls down."""
    arguments = {"num_envs": 8, "episode_seconds": 0.5, "joint_noise": 0.0, "velocity_noise": 0.0}
    plain = gym.make_vec(WALK, action_layer="base_acceleration", **arguments)
    given = {"command_curriculum": True, "difficulty": 0.3, "autoreset_mode": "SAME_STEP"}
    envs = gym.make_vec(WALK, action_layer="base_acceleration", **arguments, **given)
    where = envs.chunks.batches[0].observation_columns["command"]
    whole, part = (env.reset(seed=0)[0][:, where] for env in (plain, envs))
    np.testing.assert_allclose(part, 0.3 * whole, rtol=1e-5)
    zero, levels = np.zeros(envs.action_space.shape), []
    for _ in range(51):
        levels.append(envs.step(zero)[4]["command_level"])
    assert (levels[0] == 3).all() and (levels[25] == 4).mean() > 0.5 and (levels[50] >= 4).any()
    again = envs.reset(seed=0)[0][:, where]
    np.testing.assert_array_equal(again, part)  # a seed takes them back
    throw = gym.make_vec(WALK, **TORQUE, **arguments, **given)
    throw.reset(seed=0)
    for _ in range(60):
        *_, info = throw.step(np.ones(throw.action_space.shape))
    assert (info["command_level"] < 3).all()
    with pytest.raises(FbidError, match="task of a command_curriculum: 'balance'. Expected one wi"):
        gym.make(BIPED, command_curriculum=True)
