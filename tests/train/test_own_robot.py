"""A run on a robot of the user's keeps it, and nothing is played on another one unsaid."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import stand_in

import eval.rollout
import train.ppo
from eval.compare import main as compare
from fbid_gym import make_sb3
from fbid_gym.errors import InvalidValueError, RunError
from fbid_gym.policy import Policy
from fbid_gym.robots import Robot, load, zoo
from train.runs.config import TrainConfig
from train.runs.reading import load as load_run
from train.runs.robots import of_policy
from train.runs.tables import read_rows

ANIMAL = zoo.draw(22)
ENV = "fbid_gym/QuadrupedBalance-v0"
EPISODES = 3  # of an evaluation


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a robot.toml and a run of it."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "dog.xml").write_text(zoo.mjcf(ANIMAL))
    feet = json.dumps(ANIMAL.foot_names)
    (folder / "robot.toml").write_text(f'mjcf = "dog.xml"\nname = "dog"\nfeet = {feet}\n')
    train.ppo.main(config(folder))
    return folder


def config(folder: Path, **changes: Any) -> TrainConfig:
    own = {"env_args": {"episode_seconds": 0.5}, "robot": str(folder / "robot.toml")}
    return stand_in.tiny(folder / "run", **own | changes)


def returns(folder: Path, *words: str) -> float:
    out = folder / "metrics.json"
    arguments = [*("--episodes", str(EPISODES)), *("--seed", "10000"), *("--out", str(out))]
    assert eval.rollout.main([*words, *arguments]) == 0
    return json.loads(out.read_text())["summary"]["returned"]["mean"]


def test_the_run_says_which_robot_and_keeps_it(folder):
    own = Robot.load(folder / "robot.toml")
    run = load_run(folder / "run")
    assert run.robot is not None and run.robot.digest == own.digest
    asked = json.loads((folder / "run" / "config.json").read_text())
    name = {"name": "dog", "sha256": own.digest}
    assert asked["env_args"]["robot"] == run.policy.env_args["robot"] == name
    assert "robot" not in asked and "feet" not in asked


def test_it_is_played_where_it_was_trained(folder):
    """Also without the files that it came from; to the last digit."""
    moved = folder / "moved"
    shutil.copytree(folder / "run", moved)
    (folder / "dog.xml").rename(folder / "gone.xml")
    last = float(read_rows(moved / "evaluations.csv")[-1]["return_mean"])
    try:
        assert returns(folder, str(moved)) == pytest.approx(last, rel=1e-12)
        assert returns(folder, str(moved / "policy.safetensors")) == pytest.approx(last, rel=1e-12)
    finally:
        (folder / "gone.xml").rename(folder / "dog.xml")


def test_a_policy_alone_asks_for_its_robot(folder, tmp_path, capsys):
    policy = Path(shutil.copy(folder / "run" / "policy.safetensors", tmp_path))
    assert eval.rollout.main([str(policy), "--episodes", "1"]) == 2
    assert "the policy was trained on robot 'dog' (" in capsys.readouterr().err
    with pytest.raises(InvalidValueError, match="robot"):
        gym.make(ENV, **Policy.load(policy).env_args)
    words = [str(policy), "--robot", str(folder / "run" / "robot.zip")]
    assert returns(tmp_path, *words) == returns(tmp_path, str(folder / "run"))
    assert "is played on" not in capsys.readouterr().out


def test_another_robot_is_played_on_only_with_a_word(folder, tmp_path, capsys):
    run = str(folder / "run")
    returns(tmp_path, run, "--robot", "quadruped")
    assert "run was trained on robot 'dog' (" in capsys.readouterr().out
    out = tmp_path / "report.html"
    few = ["--episodes", "2", "--pushes", "0.2", "--push-episodes", "2", "--samples", "50"]
    words = [run, "--robot", "quadruped", "--out", str(out), "--video-seconds", "0", *few]
    assert compare(words) == 0
    assert "is played on robot 'quadruped'" in " ".join(capsys.readouterr().out.split())
    assert "is played on robot" in out.read_text()


def test_a_resume_is_of_the_same_robot(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "own")
    mine = tmp_path / "own"
    again = config(mine, total_steps=96)
    train.ppo.main(again)
    heavier = zoo.mjcf(replace(ANIMAL, mass=1.1 * ANIMAL.mass))
    (mine / "dog.xml").write_text(heavier)
    before = (mine / "run" / "config.json").read_bytes()
    with pytest.raises(RunError, match=r"env_args.robot.sha256 .* instead of"):
        train.ppo.main(replace(again, total_steps=128))
    assert (mine / "run" / "config.json").read_bytes() == before
    kept = replace(again, robot=str(mine / "run" / "robot.zip"), total_steps=128)
    train.ppo.main(kept)
    assert int(read_rows(mine / "run" / "progress.csv")[-1]["steps"]) == 128


def test_a_robot_that_comes_with_the_environments_is_kept_too(tmp_path):
    robot = Robot.from_mjcf(zoo.mjcf(ANIMAL), ANIMAL.foot_names)

    def make_env(env_id: str, **arguments: Any) -> Any:
        return make_sb3(env_id, **{**arguments, "robot": robot})

    run = train.ppo.main(config(tmp_path, robot=None), make_env)
    kept = of_policy(run, Policy.load(run).env_args)
    assert kept is not None and kept.digest == robot.digest
    last = float(read_rows(run / "evaluations.csv")[-1]["return_mean"])
    np.testing.assert_allclose(returns(tmp_path, str(run)), last, rtol=1e-3)


def test_a_robot_that_is_not_the_one_of_the_policy_is_refused(folder, tmp_path):
    run = tmp_path / "run"
    shutil.copytree(folder / "run", run)
    load("quadruped").save(run / "robot.zip")
    with pytest.raises(RunError, match="holds robot 'quadruped'.*Expected the robot of the policy"):
        load_run(run)
