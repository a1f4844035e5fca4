from dataclasses import replace
from pathlib import Path

import pytest

from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy
from train.recipes import config_for
from train.runs.command_line import options, parse, stored_options
from train.runs.config import EvaluationConfig, PPOConfig, SACConfig, TrainConfig
from train.runs.folder import RunFolder

FOLDER = RunFolder.of(Path("runs/some"))
USUAL = config_for(TrainConfig.env, TrainConfig.action_layer)
"""What is trained where the command line says nothing."""


@pytest.mark.parametrize(
    "config",
    [
        TrainConfig(),
        TrainConfig(env="fbid_gym/QuadrupedWalk-v0", action_layer="joint_position"),
        TrainConfig(
            env="fbid_gym/BipedSquat-v0",
            action_layer="com_wrench",
            layer_options={"contact_limits": "none"},
            env_args={"push_force": [50, 150], "terrain": "a 'name' with \"quotes\""},
            seed=7,
            total_steps=1234,
            num_threads=1,
            out=Path("some where/run"),
            overwrite=True,
            ppo=PPOConfig(learning_rate=1e-5, target_kl=None, hidden=(32, 16),
                          normalise_reward=True, activation="elu"),
            eval=EvaluationConfig(every=10, episodes=3),
        ),
        TrainConfig(algorithm="sac", env="fbid_gym/QuadrupedWalk-v0", seed=2,
                    sac=SACConfig(tau=0.1, hidden=(8,), learning_rate_end=None)),
        TrainConfig(start="shipped:any-quadruped", ppo=PPOConfig(gamma=0.9)),
    ],
)  # fmt: skip
def test_options_are_the_command_line_of_the_configuration(config):
    assert parse(list(options(config)), config.algorithm) == config
    again = replace(config, num_threads=0, out=None, overwrite=False)
    assert parse(list(stored_options(config.to_json(), FOLDER)), config.algorithm) == again


def test_a_training_begins_with_a_policy_as_that_was_trained():
    policy = Policy.load(shipped := "shipped:any-quadruped")
    config = parse(["--start", shipped, "--robot", "go1", "--seed", "3"])
    assert config.make_args() == policy.env_args and config.env == policy.env_id
    assert (config.robot, config.seed, config.start) == ("go1", 3, shipped)
    assert [w.shape[0] for w in policy.weights[:-1]] == list(config.ppo.hidden)
    assert config.ppo.activation == policy.activation
    with pytest.raises(FbidError, match="nowhere"):
        parse(["--start", "nowhere"])


def test_options_of_another_algorithm_are_refused():
    for algorithm, word in (("ppo", "--sac.tau"), ("sac", "--ppo.gamma=0.5")):
        with pytest.raises(FbidError, match=f"Invalid option: '{word}'.*train.{algorithm}"):
            parse([word, "0.1"], algorithm)
    with pytest.raises(FbidError, match="Unknown algorithm 'dqn'. Valid choices: ppo, sac"):
        stored_options({**TrainConfig().to_json(), "algorithm": "dqn"}, FOLDER)


@pytest.mark.parametrize("then", [[], ["--seed", "3"]])
def test_no_robots_are_refused_where_a_list_of_them_is_begun(then):
    with pytest.raises(FbidError, match="at least one robot"):
        parse(["--robots", *then])


def test_options_say_only_what_is_not_the_default():
    assert options(USUAL) == ()
    own = replace(USUAL, seed=3, ppo=replace(USUAL.ppo, gamma=0.9))
    assert options(own) == (*("--seed", "3"), *("--ppo.gamma", "0.9"))
    of_none = TrainConfig(env="mine/Own-v0", ppo=PPOConfig(gamma=0.9))
    assert options(of_none) == (*("--env", "mine/Own-v0"), *("--ppo.gamma", "0.9"))


def test_stored_options_of_another_version_are_those_that_there_are():
    stored = replace(USUAL, seed=3).to_json()
    del stored["torch_threads"]
    stored["ppo"]["rollouts"] = 7
    stored |= {"colour": "blue", "checkpoint_every": 5}
    assert stored_options(stored, FOLDER) == ("--seed", "3")


@pytest.mark.parametrize(
    ("robot", "words"),
    [("go1", ("--robot", "go1")), ({"name": "dog"}, ("--robot", str(FOLDER.robot)))],
)
def test_stored_options_name_the_robot_or_the_file_that_keeps_it(robot, words):
    stored = replace(USUAL, env_args={"robot": robot, "push_force": [1, 2]}).to_json()
    assert stored_options(stored, FOLDER) == ("--env-args", '{"push_force": [1, 2]}', *words)
