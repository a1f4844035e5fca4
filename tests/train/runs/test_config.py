import dataclasses
import inspect
import json
from pathlib import Path

import pytest

from fbid_gym.actions.ranges import Falling
from fbid_gym.errors import InvalidValueError, UnknownOptionError
from train.recipes import config_for
from train.runs.command_line import parse
from train.runs.config import (
    EvaluationConfig,
    LearnerConfig,
    PPOConfig,
    SACConfig,
    TrainConfig,
)


def test_command_line_of_the_readme():
    config = parse(
        "--env fbid_gym/BipedBalance-v0 --action-layer base_acceleration --seed 3".split()
    )
    usual = config_for(TrainConfig.env, TrainConfig.action_layer)
    assert config == dataclasses.replace(usual, seed=3)
    assert config.folder == Path("runs/BipedBalance-v0-base_acceleration-s3")
    assert config.make_args() == {"action_layer": "base_acceleration"}


def test_command_line_reaches_every_level():
    config = parse(
        [
            *("--recipe", "none"),
            *("--layer-options", '{"contact_limits": "none"}'),
            *("--env-args", '{"push_force": [50, 150]}'),
            *("--eval.every", "0"),
            *("--ppo.hidden", "32", "16"),
            *("--ppo.activation", "elu"),
            *("--out", "somewhere"),
            "--overwrite",
        ]
    )
    assert config.make_args() == {
        "action_layer": "base_acceleration",
        "layer_options": {"contact_limits": "none"},
        "push_force": [50, 150],
    }
    assert config.eval == EvaluationConfig(every=0)
    assert config.ppo == PPOConfig(hidden=(32, 16), activation="elu")
    assert config.folder == Path("somewhere") and config.overwrite


@pytest.mark.parametrize("text", ["{", "[1]", "3", "{'a': 1}"])
def test_command_line_refuses_what_is_not_a_json_object(text, capsys):
    with pytest.raises(SystemExit):
        parse(["--env-args", text])
    assert "--env-args" in capsys.readouterr().err


def test_every_option_is_explained():
    """The docstring under each field is its help; without one tyro shows nothing."""
    for kind in (TrainConfig, LearnerConfig, PPOConfig, SACConfig, EvaluationConfig):
        lines = inspect.getsource(kind).splitlines()
        for name in kind.__annotations__:
            (at,) = (i for i, line in enumerate(lines) if line.startswith(f"    {name}: "))
            assert lines[at + 1].startswith('    """')


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seed": -1}, "Invalid seed: -1. Expected a whole number from 0"),
        ({"num_envs": 0}, "Invalid num_envs: 0"),
        ({"total_steps": 0.5}, "Invalid total_steps: 0.5. Expected a whole number"),
        ({"ppo": PPOConfig(batch_size=1000)}, r"Invalid ppo\.batch_size: 1000.*= 4096"),
        ({"num_envs": 1, "ppo": PPOConfig(n_steps=1)}, r"Invalid ppo\.n_steps: 1"),
        ({"sac": SACConfig()}, "Invalid hyperparameters: 'sac'. Expected those of 'ppo' alone"),
        ({"algorithm": "sac", "ppo": PPOConfig()}, "Invalid hyperparameters: 'ppo'"),
        ({"algorithm": "sac", "sac": SACConfig(buffer_size=100)}, r"sac\.n_steps = 1024 to"),
        ({"env_args": {"seed": 3}}, "no 'seed', which has an option of its own"),
        ({"env_args": {"x": object()}}, "Invalid env_args.*values JSON can hold"),
        (
            {"layer_options": {"swing_frequency": Falling(2.0)}},
            r"Invalid layer_options.swing_frequency: Falling\(times=2.0\). .*what JSON can hold",
        ),
        ({"layer_options": {"x": float("nan")}}, "Invalid layer_options.*values JSON can hold"),
    ],
)
def test_invalid_values_are_named(changes, message):
    with pytest.raises(InvalidValueError, match=message):
        TrainConfig(**changes)


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (EvaluationConfig, {"episodes": 0}, r"Invalid eval\.episodes: 0"),
        (PPOConfig, {"gamma": 1.5}, r"Invalid ppo\.gamma: 1\.5. Expected a number from 0 to 1"),
        (PPOConfig, {"hidden": (64, 0)}, r"Invalid ppo\.hidden: 0"),
        (SACConfig, {"buffer_size": 10**9}, "from 1 to 10,000,000"),
        (SACConfig, {"learning_rate_end": 2.0}, r"Invalid sac\.learning_rate_end: 2\.0"),
    ],
)
def test_invalid_hyperparameters_are_named(kind, values, message):
    with pytest.raises(InvalidValueError, match=message):
        kind(**values)


def test_large_batches_mean_the_whole_iteration():
    config = TrainConfig(num_envs=4, ppo=PPOConfig(n_steps=8))
    assert config.batch_size == config.iteration_steps == 32


def test_json_has_everything_a_reader_needs():
    data = TrainConfig(layer_options={"contact_limits": "none"}, num_threads=2).to_json()
    assert json.loads(json.dumps(data)) == data
    assert data["env_id"] == "fbid_gym/BipedBalance-v0"
    assert data["action_layer"] == data["env_args"]["action_layer"] == "base_acceleration"
    assert data["env_args"]["layer_options"] == {"contact_limits": "none"}
    assert data["ppo"]["hidden"] == [64, 64] and data["eval"]["seed"] == 10_000


@pytest.mark.parametrize("algorithm", ["dqn", ["sac"], None])
def test_an_unknown_algorithm_is_named(algorithm):
    with pytest.raises(UnknownOptionError, match=r"Unknown algorithm .*choices: ppo, sac"):
        TrainConfig(algorithm=algorithm)
