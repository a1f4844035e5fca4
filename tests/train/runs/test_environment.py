"""Runs whose environment is no longer what it was when they began."""

import json
from pathlib import Path
from typing import Any

import pytest
import stand_in

from train.runs.environment import as_trained, changed_meaning
from train.runs.files import read_json
from train.runs.opening import open_run

ROBOT = {"env": "fbid_gym/BipedBalance-v0", "action_layer": "base_acceleration"}


@pytest.fixture
def began(tmp_path):
    """The folder of a run with robots that has begun."""
    with open_run(stand_in.config(tmp_path / "run", **ROBOT)) as run:
        run.begin()
    return run.folder.path


def rewrite(file: Path, **then: Any) -> None:
    file.write_text(json.dumps(read_json(file) | then))


def test_nothing_is_said_where_nothing_changed_or_nothing_is_known(began, tmp_path):
    assert changed_meaning(began) is None
    assert changed_meaning(tmp_path) is None
    with open_run(stand_in.config(tmp_path / "foreign")) as run:
        run.begin()
    assert changed_meaning(run.folder.path) is None


def test_what_changed_is_named(began):
    rewrite(began / "environment.json", push_duration=0.2, randomisation={"mass": 0.1})
    said = changed_meaning(began) or ""
    assert said.startswith("run was trained in another environment than")
    assert "push_duration 0.15 instead of 0.2" in said
    assert "randomisation.mass 0.0 instead of 0.1" in said
    assert "friction" not in said and "push_force" not in said


def test_what_a_run_did_not_know_of_yet_is_no_change(began):
    """Arguments and options that are younger than the run were at their defaults."""
    file = began / "environment.json"
    known = read_json(file)
    for name in ("reward_weights", "reward_scales"):
        del known[name]
    del known["layer_options"]["compensate_friction"]
    file.write_text(json.dumps(known))
    assert changed_meaning(began) is None
    rewrite(file, reward_weights={"height": 0.5}, given_up=3)
    said = changed_meaning(began) or ""
    assert "reward_weights.height 0.25 instead of 0.5" in said
    assert "reward_weights.torque 0.15 instead of unset" in said
    assert "given_up unset instead of 3" in said and "reward_scales" not in said


def test_a_run_of_before_damps_the_velocity_of_the_centre_of_mass(tmp_path):
    walk = {"env": "fbid_gym/QuadrupedWalk-v0", "action_layer": "base_acceleration"}
    with open_run(stand_in.config(tmp_path / "run", **walk)) as run:
        run.begin()
    file = run.folder.path / "environment.json"
    options = read_json(file)["layer_options"]
    assert options.pop("velocity_of") == "base" and options["velocity_gain"] == 4.0
    rewrite(file, layer_options=options | {"velocity_gain": 0.0})
    before = {"velocity_of": "com", "velocity_gain": 0.0}
    assert as_trained(run.folder.path, {})["layer_options"] == before


def test_a_run_of_before_has_legs_that_do_not_hold_their_own_weight(tmp_path):
    walk = {"env": "fbid_gym/QuadrupedWalk-v0", "action_layer": "joint_position"}
    with open_run(stand_in.config(tmp_path / "run", **walk)) as run:
        run.begin()
    options = read_json(run.folder.environment)["layer_options"]
    assert options.pop("leg_weight")
    rewrite(run.folder.environment, layer_options=options)
    assert as_trained(run.folder.path, {})["layer_options"] == {"leg_weight": False}


def test_options_of_the_layer_are_those_of_the_training(began):
    """Whatever is the default today; those that there are no more are passed over."""
    arguments = read_json(began / "config.json")["env_args"]
    assert as_trained(began, arguments) == arguments
    options = read_json(began / "environment.json")["layer_options"]
    rewrite(began / "environment.json", layer_options=options | {"friction": 0.5, "given_up": 3})
    assert as_trained(began, arguments)["layer_options"] == {"friction": 0.5}
    assert changed_meaning(began) is None
