"""A training on several robots, and its policy on one that it never saw."""

import csv
import json

import pytest

from eval import transfer
from fbid_gym.errors import InvalidValueError
from fbid_gym.policy import Policy
from train.ppo import main
from train.runs.config import EvaluationConfig, PPOConfig, TrainConfig

ROBOTS = ("go1", "zoo:quadruped:0")


def config(tmp_path, robots):
    return TrainConfig(
        env="fbid_gym/QuadrupedWalk-v0",
        env_args={"observation": "body", "episode_seconds": 0.2},
        robots=robots,
        num_envs=4,
        total_steps=8,
        ppo=PPOConfig(n_steps=2, hidden=(8,)),
        eval=EvaluationConfig(every=0),
        out=tmp_path / "run",
    )


def test_a_policy_of_several_robots_acts_on_others(tmp_path, capsys):
    run = main(config(tmp_path, ROBOTS))
    assert json.loads((run / "config.json").read_text())["env_args"]["robots"] == list(ROBOTS)
    assert "robots" not in Policy.load(run).env_args
    out = tmp_path / "table.csv"
    names = ["go1", "zoo:quadruped:1000", "biped"]
    asked = [str(run), "--robots", *names, "--episodes", "2", "--out", str(out)]
    assert transfer.main(asked) == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [row["robot"] for row in rows] == [name for name in names for _ in range(2)]
    assert [int(row["episodes"]) for row in rows] == [2, 2, 2, 2, 0, 2]
    said = " ".join(capsys.readouterr().out.split())
    assert "cannot act" in said and "on 2 robots" in said


def test_robots_for_tests_are_not_trained_on(tmp_path):
    with pytest.raises(InvalidValueError, match="below 1000"):
        main(config(tmp_path, ("go1", "zoo:quadruped:1000")))
    assert not (tmp_path / "run" / "config.json").exists()
