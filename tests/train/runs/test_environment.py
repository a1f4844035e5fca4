"""Runs whose environment is no longer what it was when they began."""

import json
from pathlib import Path
from typing import Any

import pytest
import stand_in

from fbid_gym.errors import RunError
from train.runs.environment import changed_meaning
from train.runs.files import read_json
from train.runs.opening import open_run

ROBOT = {"env": "fbid_gym/BipedBalance-v0", "action_layer": "base_acceleration"}


@pytest.fixture
def began(tmp_path: Path) -> Path:
    """The folder of a run with robots that has begun."""
    with open_run(stand_in.config(tmp_path / "run", **ROBOT)) as run:
        run.begin()
    return run.folder.path


def rewrite(file: Path, **then: Any) -> None:
    file.write_text(json.dumps(read_json(file) | then))


def test_nothing_is_said_where_nothing_changed_or_nothing_is_known(
    began: Path, tmp_path: Path
) -> None:
    assert changed_meaning(began) is None
    assert changed_meaning(tmp_path) is None
    with open_run(stand_in.config(tmp_path / "foreign")) as run:
        run.begin()
    assert changed_meaning(run.folder.path) is None


def test_what_changed_is_named(began: Path) -> None:
    rewrite(began / "environment.json", push_duration=0.2, randomisation={"mass": 0.0})
    said = changed_meaning(began) or ""
    assert said.startswith("run was trained in another environment than")
    assert "push_duration 0.15 instead of 0.2" in said
    assert "randomisation.friction [1.0, 1.0] instead of unset" in said
    assert ".mass " not in said and "push_force" not in said


def test_arguments_that_are_no_longer_valid_are_named(began: Path) -> None:
    arguments = read_json(began / "config.json")["env_args"]
    rewrite(began / "config.json", env_args=arguments | {"layer_options": {"softness": 1}})
    assert "not valid today: Unknown option of action layer" in (changed_meaning(began) or "")


@pytest.mark.parametrize("name", ["config.json", "environment.json"])
def test_a_damaged_file_is_named(began: Path, name: str) -> None:
    (began / name).write_text("{")
    with pytest.raises(RunError, match=f"{name}: not JSON"):
        changed_meaning(began)
