"""Runs whose environment is no longer what it was when they began."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from eval.environment import changed_meaning
from eval.rollout import main
from eval.runs import check_comparable, load
from fbid_gym.envs.config import resolved_arguments
from fbid_gym.errors import RunError

Build = Callable[..., Path]
BIPED = "fbid_gym/BipedBalance-v0"


def as_if_of(env_id: str, folder: Path, **then: Any) -> Path:
    """Let a run of the stand-in say that it is of a robot, with other defaults when it began."""
    config = json.loads((folder / "config.json").read_text()) | {"env_id": env_id}
    (folder / "config.json").write_text(json.dumps(config))
    resolved = resolved_arguments(env_id, config["env_args"])
    assert resolved is not None
    (folder / "environment.json").write_text(json.dumps(resolved | then))
    return folder


def test_nothing_is_said_where_nothing_changed_or_nothing_is_known(
    run_folder: Build, tmp_path: Path
) -> None:
    assert changed_meaning(run_folder()) is None
    assert changed_meaning(tmp_path) is None
    assert changed_meaning(as_if_of(BIPED, run_folder(seed=1))) is None


def test_what_changed_is_named(run_folder: Build) -> None:
    folder = as_if_of(BIPED, run_folder(), push_duration=0.2, randomisation={"mass": 0.0})
    said = changed_meaning(folder) or ""
    assert said.startswith("base_acceleration-s0 was trained in another environment than")
    assert "push_duration 0.15 instead of 0.2" in said
    assert "randomisation.friction [1.0, 1.0] instead of unset" in said
    assert ".mass " not in said and "push_force" not in said


def test_arguments_that_are_no_longer_valid_are_named(run_folder: Build) -> None:
    folder = as_if_of(BIPED, run_folder())
    config = json.loads((folder / "config.json").read_text())
    config["env_args"]["layer_options"] = {"softness": 1}
    (folder / "config.json").write_text(json.dumps(config))
    assert "not valid today: Unknown option of action layer" in (changed_meaning(folder) or "")


def test_a_damaged_file_is_named(run_folder: Build) -> None:
    folder = as_if_of(BIPED, run_folder())
    (folder / "environment.json").write_text("{")
    with pytest.raises(RunError, match=r"environment\.json: not readable as JSON"):
        changed_meaning(folder)


def test_comparisons_and_rollouts_say_it(
    run_folder: Build, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = run_folder()
    run = load(folder)
    as_if_of(BIPED, folder, push_duration=0.2)
    (warning,) = check_comparable([run])
    assert "push_duration 0.15 instead of 0.2" in warning
    assert main([str(folder), "--episodes", "1"]) == 0
    assert warning in capsys.readouterr().out.splitlines()
