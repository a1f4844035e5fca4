"""A training on several robots, and its policy on one that it never saw."""

import csv
import json
from dataclasses import replace

import pytest

from eval import compare, transfer
from eval.robustness.__main__ import main as robustness
from eval.rollout import RolloutConfig, player_of
from eval.tools.ship import ShipConfig, ship
from fbid_gym.errors import InvalidValueError
from fbid_gym.policy import Policy
from fbid_gym.robots import load
from train.ppo import main
from train.runs.config import EvaluationConfig, PPOConfig, TrainConfig
from train.runs.robots import another

ENV, ROBOTS = "fbid_gym/QuadrupedWalk-v0", ("go1", "zoo:quadruped:0")


def config(tmp_path, robots):
    env = {"env": ENV, "env_args": {"observation": "body", "episode_seconds": 0.2}}
    short = {"num_envs": 4, "total_steps": 8, "ppo": PPOConfig(n_steps=2, hidden=(8,))}
    short |= {"eval": EvaluationConfig(every=8, episodes=2), "out": tmp_path / "run"}
    return TrainConfig(**env, **short, robots=robots)


def test_a_policy_of_several_robots_acts_on_others(tmp_path, capsys):
    run = main(config(tmp_path, ROBOTS))
    assert json.loads((run / "config.json").read_text())["env_args"]["robots"] == list(ROBOTS)
    assert "robots" not in Policy.load(run).env_args
    out = tmp_path / "table.csv"
    names = ["go1", "zoo:quadruped:1000", "biped"]
    asked = [str(run), "--robots", *names, "--episodes", "2", "--gain", "4", "--out", str(out)]
    assert transfer.main(asked) == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [row["robot"] for row in rows] == [name for name in names for _ in range(3)]
    players = ["run", "zero, base_acceleration", "proportional:4, base_acceleration"]
    assert [row["policy"] for row in rows] == 3 * players
    assert [int(row["episodes"]) for row in rows] == [2, 2, 2, 2, 2, 2, 0, 2, 2]
    said = " ".join(capsys.readouterr().out.split())
    assert "cannot act" in said and "on 2 robots" in said and "acts on 4 feet" in said
    asked[2:5] = ["go1", "go1", "biped"]  # as files of two robots that give the same name
    assert transfer.main([*asked[:-4], "--who", "laws", "--out", str(out)]) == 0
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [row["robot"] for row in rows] == ["go1 (1)", "go1 (2)", "biped"]

    asked = ShipConfig(run, "QuadrupedWalk-v0/any", 20, unseen=("quadruped",), unseen_episodes=2)
    card = ship(replace(asked, out=tmp_path / "policies")).card
    assert card.robots == ROBOTS and f"--robots {' '.join(ROBOTS)}" in card.command
    assert "2 robots: go1, zoo:quadruped:0; measured on go1." in card.transfer()[0]
    assert "never saw, 2 episodes each" in card.transfer()[1]
    (there,) = card.unseen
    assert (there.robot, there.joints) == ("quadruped", load("quadruped").num_joints)
    with pytest.raises(InvalidValueError, match="did not learn with"):
        ship(replace(asked, unseen=("zoo:quadruped:0",), out=tmp_path / "others"))
    name = another(run, {}, load("quadruped"))
    assert name == "run was trained on 2 robots and is played on robot 'quadruped'."
    assert another(run, {}, load("go1")) is None

    player = player_of(RolloutConfig(run))
    assert player.make_args["robots"] == list(ROBOTS)
    assert another(run, player.make_args, None) is None
    both = ("zoo:quadruped:1000-1001",)
    assert player_of(RolloutConfig(run, robots=both)).make_args["robots"] == list(both)
    name = another(run, {"robots": both}, None)
    assert name.endswith("is played on robots zoo:quadruped:1000, zoo:quadruped:1001.")
    assert "robots" not in player_of(RolloutConfig(run, robot="go1")).make_args
    for wrong in ({"robot": "go1", "robots": both}, {"env_args": '{"robots": ["go1"]}'}):
        with pytest.raises(InvalidValueError, match="robots"):
            player_of(RolloutConfig(run, **wrong))

    page = tmp_path / "page.html"
    command = [str(run), "--robots", "go1", *both, "--episodes", "3", "--out", str(page)]
    assert robustness([*command, "--factors", "push", "model-com", "--seconds", "0.1"]) == 0
    found = json.loads(page.with_suffix(".json").read_text())
    assert found["env_args"]["robots"] == ["go1", *both]
    assert found["left_out"] == {"model-com": "the robots differ in height"}
    short = ["--pushes", "0.5", "--push-episodes", "3", "--push-seconds", "0.1"]
    assert compare.main([*command, *short, "--video-seconds", "0.1"]) == 0
    assert "is played on robots go1, zoo:quadruped:1000" in page.read_text()


def test_robots_for_tests_are_not_trained_on(tmp_path):
    with pytest.raises(InvalidValueError, match="below 1000"):
        main(config(tmp_path, ("go1", "zoo:quadruped:1000")))
    assert not (tmp_path / "run" / "config.json").exists()
