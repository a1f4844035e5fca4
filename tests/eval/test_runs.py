"""Run folders that are missing, incomplete or not comparable, and what is said about them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from eval.runs import check_comparable, group, load, shared_settings
from fbid_gym.errors import FbidError, RunError
from fbid_gym.policy import Policy

Build = Callable[..., Path]


def test_a_run_is_read(run_folder: Build) -> None:
    run = load(run_folder("joint_position", 3, layer_options={"stiffness": 2}))
    assert run.layer == "joint position (stiffness: 2)"
    assert run.seed == 3 and run.policy.trained_steps == 1_000_000
    assert run.curve is not None and run.curve.steps[-1] == 1_000_000
    assert run.curve.returns.shape == run.curve.wall_seconds.shape == (21,)


def test_an_exported_policy_is_read(tmp_path: Path, policy: Callable[..., Policy]) -> None:
    policy(0.3).save(tmp_path / "exported")
    run = load(tmp_path / "exported")
    assert run.layer == "base acceleration"
    assert run.seed is None and run.curve is None and run.config is None


def damage(name: str, content: str | None) -> Callable[[Path], None]:
    def apply(folder: Path) -> None:
        if content is None:
            (folder / name).unlink()
        else:
            (folder / name).write_text(content)

    return apply


def without(key: str) -> Callable[[Path], None]:
    def apply(folder: Path) -> None:
        config = json.loads((folder / "config.json").read_text())
        del config[key]
        (folder / "config.json").write_text(json.dumps(config))

    return apply


def unfinished(folder: Path) -> None:
    lines = (folder / "evaluations.csv").read_text().splitlines(keepends=True)
    (folder / "evaluations.csv").write_text("".join(lines[:10]))


def renamed(folder: Path) -> None:
    config = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps(config | {"env_id": "other/Env-v0"}))


@pytest.mark.parametrize(
    ("break_it", "message"),
    [
        (damage("evaluations.csv", None), "evaluations.csv is missing"),
        (damage("versions.json", None), "versions.json is missing"),
        (damage("policy/policy.json", None), "policy.json: cannot be read"),
        (damage("config.json", "{"), "config.json: not readable as JSON"),
        (damage("config.json", "[]"), "config.json: expected a JSON object"),
        (damage("evaluations.csv", "steps,wall_seconds\n"), "evaluations.csv: holds no evaluation"),
        (
            damage("evaluations.csv", "steps\n1\n"),
            "evaluations.csv: column 'wall_seconds' is missing",
        ),
        (
            damage("evaluations.csv", "steps,wall_seconds,return_mean,episodes\n1,2,x,8\n"),
            "evaluations.csv: column 'return_mean' holds more than numbers",
        ),
        (
            damage(
                "evaluations.csv", "steps,wall_seconds,return_mean,episodes\n2,2,2,8\n1,3,3,8\n"
            ),
            "the steps do not increase",
        ),
        (without("seed"), "config.json: 'seed' is missing"),
        (unfinished, "trained for 400000 of 1000000 steps. Resume it, or leave it out."),
        (renamed, "config.json says other/Env-v0, the policy in it was trained in eval_tests/"),
    ],
)
def test_a_broken_run_is_named(
    run_folder: Build, break_it: Callable[[Path], None], message: str
) -> None:
    folder = run_folder()
    break_it(folder)
    with pytest.raises(FbidError) as caught:
        load(folder)
    assert message in str(caught.value) and str(folder) in str(caught.value)


def test_a_folder_that_is_no_run_is_named(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="nowhere: no such folder. Expected a run folder or an"):
        load(tmp_path / "nowhere")
    with pytest.raises(FbidError, match="no policy here"):
        load(tmp_path)


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
    for name in ("config.json", "policy/policy.json"):
        path = other / name
        path.write_text(path.read_text().replace("StandIn-v0", "Another-v0"))
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
            {"ppo": {"learning_rate": 1e-3, "hidden": [64, 64]}},
            "ppo.learning_rate 0.001 instead of 0.0003",
        ),
        ({"num_envs": 8}, "num_envs 8 instead of 64"),
        ({"total_steps": 500_000}, "total_steps 500000 instead of 1000000"),
        ({"gamma": 0.9}, "gamma 0.9 instead of unset"),
    ],
)
def test_other_training_is_a_warning(
    run_folder: Build, changes: dict[str, Any], message: str
) -> None:
    runs = [load(run_folder()), load(run_folder("joint_position", 0, **changes))]
    (warning,) = check_comparable(runs)
    assert message in warning and "joint_position-s0 was not trained like base_acc" in warning


def test_other_machines_and_numbers_and_equal_seeds_are_warnings(run_folder: Build) -> None:
    folders = [run_folder(), run_folder("joint_position", 0), run_folder(name="again")]
    (folders[1] / "versions.json").write_text('{"platform": "another", "git": {"commit": "b"}}')
    warnings = "\n".join(check_comparable([load(folder) for folder in folders]))
    assert "different machines: a test, another" in warnings
    assert "different versions of this project" in warnings
    assert "several runs have seed 0" in warnings
    assert "different numbers of runs: base acceleration 2, joint position 1" in warnings
