"""Which runs are compared, and what is said about what differs between them."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from eval.comparable import check_comparable, group, shared_settings
from eval.rollout import main
from fbid_gym.errors import RunError
from fbid_gym.policy import Policy
from train import ppo
from train.runs import versions
from train.runs.config import EvaluationConfig, PPOConfig, TrainConfig
from train.runs.environment import meaning
from train.runs.files import read_json
from train.runs.reading import load

Build = Callable[..., Path]


def test_runs_are_grouped_by_layer_and_its_options(run_folder: Build) -> None:
    runs = [
        load(run_folder("joint_position", 0)),
        load(run_folder("base_acceleration", 0)),
        load(run_folder("base_acceleration", 1, layer_options={"contact_limits": "none"})),
        load(run_folder("joint_position", 1)),
    ]
    sizes = {name: len(members) for name, members in group(runs).items()}
    assert sizes == {
        "joint position": 2,
        "base acceleration": 1,
        "base acceleration (contact limits: none)": 1,
    }


def test_ppo_and_sac_are_told_apart_and_their_hyperparameters_not_set_against_each_other(
    run_folder: Build,
) -> None:
    folders = [run_folder(), run_folder(name="sac", algorithm="sac")]
    runs = [load(folder) for folder in folders]
    (folders[1] / "config.json").rename(folders[1] / "away.json")
    runs.append(load(folders[1] / "policy.safetensors"))  # exported, it still knows
    assert [run.layer for run in runs] == ["base acceleration", *2 * ["base acceleration, SAC"]]
    (warning,) = check_comparable(runs[:2])
    assert 'algorithm "sac" instead of "ppo". The layer is not' in warning
    shared = shared_settings(runs[:2])
    assert shared["num_envs"] == 64 and not any("gamma" in name for name in shared)


def test_like_runs_raise_no_warning(run_folder: Build) -> None:
    runs = [load(run_folder(layer, s)) for layer in ("base_acceleration", "joint_position")
            for s in (0, 1)]  # fmt: skip
    assert check_comparable(runs) == []
    assert shared_settings(runs)["ppo.learning_rate"] == 3e-4


def test_other_environment_arguments_are_refused(run_folder: Build) -> None:
    runs = [load(run_folder()), load(run_folder(seed=1, env_args={"push_force": [1, 2]}))]
    with pytest.raises(RunError, match=r"push_force \[1, 2\] instead of unset"):
        check_comparable(runs)


def test_other_environments_are_refused(run_folder: Build) -> None:
    one, other = run_folder(), run_folder(seed=1)
    path = other / "config.json"
    path.write_text(path.read_text().replace("StandIn-v0", "Another-v0"))
    replace(Policy.load(other), env_id="eval_tests/Another-v0").save(other / "policy.safetensors")
    with pytest.raises(RunError, match="eval_tests/Another-v0.*one environment at a time"):
        check_comparable([load(one), load(other)])


def test_the_same_run_twice_is_refused(run_folder: Build) -> None:
    run = load(run_folder())
    with pytest.raises(RunError, match="given twice"):
        check_comparable([run, run])
    with pytest.raises(RunError, match="no run was given"):
        check_comparable([])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"ppo": PPOConfig(learning_rate=1e-3)},
            "ppo.learning_rate 0.001 instead of 0.0003",
        ),
        ({"num_envs": 8}, "num_envs 8 instead of 64"),
        ({"total_steps": 500_000}, "total_steps 500000 instead of 1000000"),
    ],
)
def test_other_training_is_a_warning(
    run_folder: Build, changes: dict[str, Any], message: str
) -> None:
    runs = [load(run_folder()), load(run_folder("joint_position", 0, **changes))]
    (warning,) = check_comparable(runs)
    assert message in warning and "joint_position-s0 was not trained like base_acc" in warning


@pytest.mark.parametrize(("name", "value"), [("every", 50_000), ("episodes", 8), ("seed", 7)])
def test_other_evaluations_are_a_warning(run_folder: Build, name: str, value: int) -> None:
    other = EvaluationConfig(**{name: value})
    usual = getattr(EvaluationConfig(), name)
    runs = [load(run_folder()), load(run_folder("joint_position", 0, eval=other))]
    (warning,) = check_comparable(runs)
    assert f"joint_position-s0 was not evaluated like base_acceleration-s0: eval.{name} {value} " \
           f"instead of {usual}." in warning  # fmt: skip
    assert shared_settings(runs) == shared_settings(runs[:1])


def test_other_machines_and_numbers_and_equal_seeds_are_warnings(run_folder: Build) -> None:
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


TINY = {
    "env": "fbid_gym/BipedBalance-v0",
    "env_args": {"episode_seconds": 0.2},
    "total_steps": 32,
    "num_envs": 4,
    "ppo": PPOConfig(n_steps=8, batch_size=32, n_epochs=1, hidden=(8,)),
    "eval": EvaluationConfig(every=32, episodes=2),
}


def trained(path: Path, layer: str, monkeypatch: pytest.MonkeyPatch, **how: Any) -> Path:
    """Train robots, really; the program says that it is of the commit."""
    commit = {"commit": how.pop("commit"), "uncommitted_changes": False}
    monkeypatch.setattr(versions, "_git", lambda folder: commit)
    return ppo.main(TrainConfig(**TINY, action_layer=layer, out=path, **how))


def test_warnings_of_real_runs_are_of_what_matters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Threads and checkpoints change no number; another commit may have changed every one."""
    one, other, late = (
        load(trained(tmp_path / name, layer, monkeypatch, **how))
        for name, layer, how in (
            ("one", "joint_position", {"commit": "a" * 40, "num_threads": 1}),
            ("other", "torque", {"commit": "a" * 40, "num_threads": 2, "checkpoint_every": 32}),
            ("late", "torque", {"commit": "b" * 40, "num_threads": 1}),
        )
    )
    assert one.config is not None and other.config is not None
    assert one.config["num_threads"] != other.config["num_threads"]
    assert one.config["checkpoint_every"] != other.config["checkpoint_every"]
    assert check_comparable([one, other]) == []
    (warning,) = check_comparable([one, late])
    assert warning == (
        f"The runs come from different commits of this project: {'a' * 40}, {'b' * 40}."
    )


def test_comparisons_and_rollouts_say_what_arguments_no_longer_mean(
    run_folder: Build, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run of the stand-in that says it is of a robot, with another default when it began."""
    folder = run_folder()
    run = load(folder)
    config = read_json(folder / "config.json") | {"env_id": "fbid_gym/BipedBalance-v0"}
    (folder / "config.json").write_text(json.dumps(config))
    then = (meaning(config) or {}) | {"push_duration": 0.2}
    (folder / "environment.json").write_text(json.dumps(then))
    (warning,) = check_comparable([run])
    assert "push_duration 0.15 instead of 0.2" in warning
    assert main([str(folder), "--episodes", "1"]) == 0
    assert warning in capsys.readouterr().out.splitlines()
