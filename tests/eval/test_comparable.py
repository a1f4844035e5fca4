"""Which runs are compared, and what is said about what differs between them."""

import json
from dataclasses import replace
from typing import Any

import pytest

from eval.comparable import check_comparable
from fbid_gym.errors import RunError
from fbid_gym.policy import Policy
from train import ppo
from train.runs import versions
from train.runs.config import EvaluationConfig, PPOConfig, TrainConfig
from train.runs.files import read_json
from train.runs.reading import load


def test_ppo_and_sac_are_told_apart_and_their_hyperparameters_not_set_against_each_other(
    run_folder,
):
    folders = [run_folder(), run_folder(name="sac", algorithm="sac")]
    runs = [load(folder) for folder in folders]
    (folders[1] / "config.json").rename(folders[1] / "away.json")
    runs.append(load(folders[1] / "policy.safetensors"))  # exported, it still knows
    assert [run.layer for run in runs] == ["base acceleration", *2 * ["base acceleration, SAC"]]
    (warning,) = check_comparable(runs[:2])
    assert 'algorithm "sac" instead of "ppo". The layer is not' in warning
    assert "gamma" not in warning


def test_what_cannot_be_compared_is_refused(run_folder):
    one, other = run_folder(), run_folder(seed=1)
    run, pushed = load(one), load(run_folder(seed=2, env_args={"push_force": [1, 2]}))
    path = other / "config.json"
    path.write_text(path.read_text().replace("StandIn-v0", "Another-v0"))
    replace(Policy.load(other), env_id="eval_tests/Another-v0").save(other / "policy.safetensors")
    for runs, message in (
        ([run, pushed], r"push_force \[1, 2\] instead of unset"),
        ([run, load(other)], "eval_tests/Another-v0.*one environment at a time"),
        ([run, run], "given twice"),
        ([], "no run was given"),
    ):
        with pytest.raises(RunError, match=message):
            check_comparable(runs)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, ""),
        ({"ppo": PPOConfig(learning_rate=1e-3)}, "ppo.learning_rate 0.001 instead of 0.0003"),
        ({"total_steps": 500_000}, "total_steps 500000 instead of 1000000"),
        ({"eval": EvaluationConfig(seed=7)}, "eval.seed 7 instead of 10000"),
    ],
)
def test_other_training_is_a_warning(run_folder, changes, message):
    runs = [load(run_folder()), load(run_folder("joint_position", 0, **changes))]
    warnings = check_comparable(runs)
    assert len(warnings) == bool(changes) and all(message in warning for warning in warnings)


def test_other_machines_and_numbers_and_equal_seeds_are_warnings(run_folder):
    folders = [run_folder(), run_folder("joint_position", 0), run_folder(name="again")]
    made_with = read_json(folders[1] / "versions.json")
    here, packages = made_with["platform"], made_with["packages"]
    altered = made_with | {"platform": "~ another", "packages": packages | {"numpy": "9.0"}}
    (folders[1] / "versions.json").write_text(json.dumps(altered))
    warnings = "\n".join(check_comparable([load(folder) for folder in folders]))
    assert f"different machines: {here}, ~ another" in warnings
    assert f"different versions of numpy: {packages['numpy']}, 9.0" in warnings
    assert "several runs have seed 0" in warnings
    assert "different numbers of runs: base acceleration 2, joint position 1" in warnings


TINY = {"env": "fbid_gym/BipedBalance-v0", "env_args": {"episode_seconds": 0.2}, "num_envs": 4}
TINY |= {"ppo": PPOConfig(n_steps=8, batch_size=32, n_epochs=1, hidden=(8,)), "total_steps": 32}
TINY |= {"eval": EvaluationConfig(every=32, episodes=2)}


def test_warnings_of_real_runs_are_of_what_matters(tmp_path, monkeypatch):
    """Threads and checkpoints change no number; another commit may have changed every one."""

    def trained(name: str, layer: str, commit: str, **how: Any) -> Any:
        """A training of robots, really; the program says that it is of the commit."""
        found = {"commit": commit * 40, "uncommitted_changes": False}
        monkeypatch.setattr(versions, "_git", lambda folder: found)
        return load(ppo.main(TrainConfig(**TINY, action_layer=layer, out=tmp_path / name, **how)))

    one = trained("one", "joint_position", "a", num_threads=1)
    other = trained("other", "torque", "a", num_threads=2, checkpoint_every=32)
    late = trained("late", "torque", "b", num_threads=1)
    assert one.config["num_threads"] != other.config["num_threads"]
    assert one.config["checkpoint_every"] != other.config["checkpoint_every"]
    assert check_comparable([one, other]) == []
    (warning,) = check_comparable([one, late])
    commits = f"{'a' * 40}, {'b' * 40}"
    assert warning == f"The runs come from different commits of this project: {commits}."
