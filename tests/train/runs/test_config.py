from pathlib import Path

import pytest

from fbid_gym.actions.ranges import Falling
from fbid_gym.errors import FbidError
from train.runs.command_line import parse
from train.runs.config import EvaluationConfig, PPOConfig, SACConfig, TrainConfig


def test_command_line_reaches_every_level(capsys):
    words = "--recipe none --eval.every 0 --ppo.hidden 32 16 --ppo.activation elu --overwrite"
    words = f"""{words} --layer-options {{"contact_limits":"none"}} --out somewhere"""
    config = parse(f"""{words} --env-args {{"push_force":[50,150]}}""".split())
    made = {"layer_options": {"contact_limits": "none"}, "push_force": [50, 150]}
    assert config.make_args() == made | {"action_layer": "base_acceleration"}
    assert config.eval == EvaluationConfig(every=0)
    assert config.ppo == PPOConfig(hidden=(32, 16), activation="elu")
    assert config.folder == Path("somewhere") and config.overwrite
    for text in ("{", "[1]", "3", "{'a': 1}"):
        with pytest.raises(SystemExit):
            parse(["--env-args", text])
        assert "--env-args" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (TrainConfig, {"total_steps": 0.5}, "Invalid total_steps: 0.5. Expected a whole number"),
        (TrainConfig, {"ppo": PPOConfig(batch_size=1000)}, r"ppo\.batch_size: 1000.*= 4096"),
        (TrainConfig, {"num_envs": 1, "ppo": PPOConfig(n_steps=1)}, r"Invalid ppo\.n_steps: 1"),
        (TrainConfig, {"sac": SACConfig()}, "hyperparameters: 'sac'. Expected those of 'ppo' alo"),
        (TrainConfig, {"algorithm": "sac", "sac": SACConfig(buffer_size=100)}, "1024 to"),
        (TrainConfig, {"algorithm": "dqn"}, "Unknown algorithm 'dqn'. Valid choices: ppo, sac"),
        (TrainConfig, {"env_args": {"seed": 3}}, "no 'seed', which has an option of its own"),
        (TrainConfig, {"env_args": {"x": object()}}, "Invalid env_args.*values JSON can hold"),
        (TrainConfig, {"layer_options": {"x": Falling(2.0)}}, r"x: Falling\(times=2.0\). .*JSON"),
        (TrainConfig, {"layer_options": {"x": float("nan")}}, "layer_options.*JSON can hold"),
        (EvaluationConfig, {"episodes": 0}, r"Invalid eval\.episodes: 0"),
        (PPOConfig, {"gamma": 1.5}, r"Invalid ppo\.gamma: 1\.5. Expected a number from 0 to 1"),
        (PPOConfig, {"hidden": (64, 0)}, r"Invalid ppo\.hidden: 0"),
        (SACConfig, {"learning_rate_end": 2.0}, r"Invalid sac\.learning_rate_end: 2\.0"),
    ],
)
def test_invalid_values_are_named(kind, values, message):
    with pytest.raises(FbidError, match=message):
        kind(**values)


def test_large_batches_mean_the_whole_iteration():
    config = TrainConfig(num_envs=4, ppo=PPOConfig(n_steps=8))
    assert config.batch_size == config.iteration_steps == 32
