"""Policies on the page's menu: those named, and those shipped for the environment and its robot."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eval.play.__main__ import PlayConfig, session_of, stage_of
from eval.play.session import Change
from eval.play.stage import NO_POLICY
from fbid_gym.errors import InvalidValueError
from fbid_gym.policy import Policy, shipped
from tests.eval.conftest import constant_policy

WALK = "fbid_gym/QuadrupedWalk-v0"
BODY = {"action_layer": "base_acceleration", "observation": "body"}
NAMES = [f"shipped:{each.name}" for each in shipped() if each.policy.env_id == WALK]


def saved(folder: Path, **env_args: object) -> Path:
    """A policy that is shipped, as one of the user's own."""
    policy = Policy.load(NAMES[0])
    replace(policy, env_args={**policy.env_args, **env_args}).save(folder)
    return folder


def test_shipped_policies_can_be_chosen_and_none_acts_unasked():
    session = session_of(PlayConfig())
    assert session.settings["policy"] == NO_POLICY and NAMES
    assert list(session.stage.policies) == NAMES
    for name in NAMES:
        session.play([(0, Change("policy", name))], 2)
        assert session.refused == "" and session.lanes[0].player.policy == name
        assert session.lanes[0].action.any()
    session.play([(0, Change("beside", NAMES[0]))], 2)
    assert [lane.player.policy for lane in session.lanes] == [NAMES[-1], NAMES[0]]


def test_they_are_offered_where_they_fit():
    assert not stage_of(PlayConfig(robot="quadruped")).policies
    balance = "fbid_gym/BipedBalance-v0"
    assert not stage_of(PlayConfig(env=balance, robot="humanoid")).policies
    offered = stage_of(PlayConfig(env=balance)).policies
    assert offered and all(name.startswith("shipped:BipedBalance-v0/") for name in offered)
    assert list(stage_of(PlayConfig(robot="go1")).policies) == NAMES


def test_a_policy_of_bodies_brings_robots_to_choose_from(tmp_path):
    policy = constant_policy(WALK, 26, np.zeros(14), env_args=BODY)
    policy.save(mine := tmp_path / "mine.safetensors")
    stage = stage_of(PlayConfig(policy=(mine,), robot="quadruped"))
    assert stage.robots[:2] == ("quadruped", "go1") and "biped" not in stage.robots
    assert stage.robots[2:] == tuple(f"zoo:quadruped:{seed}" for seed in range(1000, 1008))
    asked = PlayConfig(
        policy=(mine,), robots=("zoo:quadruped:4-5",), settings="robot=zoo:quadruped:5"
    )
    session = session_of(asked)
    assert session.stage.robots == ("go1", "zoo:quadruped:4", "zoo:quadruped:5")
    assert session.lanes[0].batch.robot.name == "zoo:quadruped:5" and session.hz == 50
    with pytest.raises(InvalidValueError, match="robots with 4 feet, as go1 has; it has 2"):
        stage_of(PlayConfig(policy=(mine,), robots=("biped",)))


def test_a_named_policy_acts_first_on_its_own_robot(tmp_path):
    mine = saved(tmp_path / "mine", robot="quadruped")
    stage = stage_of(PlayConfig(policy=(mine,)))
    assert stage.first == "mine" and list(stage.policies) == ["mine"]
    assert stage.config({}).load_robot().name == "quadruped"
    named = stage_of(PlayConfig(policy=(Path(NAMES[-1]),)))
    assert named.first == NAMES[-1] and sorted(named.policies) == NAMES
    with pytest.raises(InvalidValueError, match="a policy for robot 'quadruped', or --robot"):
        stage_of(PlayConfig(policy=(mine, Path(NAMES[0]))))
    assert stage_of(PlayConfig(policy=(mine, Path(NAMES[0])), robot="go1")).first == "mine"


def test_the_first_policy_brings_what_cannot_change(tmp_path):
    quick = saved(tmp_path / "quick", policy_hz=250, push_force=[0, 5], forward_range=[-0.1, 0.2])
    session = session_of(PlayConfig(policy=(quick,)))
    assert session.hz == 250 and session.stage.own["forward_range"] == [-0.1, 0.2]
    assert session.lanes[0].batch.config.push_force == (0.0, 0.0)  # the page's own
    assert list(session.stage.policies) == ["quick"]  # the shipped ones learnt at 50 Hz
    slower = stage_of(PlayConfig(policy=(quick,), env_args='{"policy_hz": 125}'))
    assert slower.config({}).policy_hz == 125 and slower.first == "quick"
    for order in ((quick, Path(NAMES[0])), (Path(NAMES[0]), quick)):
        with pytest.raises(InvalidValueError, match="policy_hz (250|50) instead of (50|250)"):
            stage_of(PlayConfig(policy=order))
    alike = saved(tmp_path / "alike", policy_hz=50, push_interval=[1.0, 2.0])
    assert len(stage_of(PlayConfig(policy=(Path(NAMES[0]), alike))).policies) == len(NAMES) + 1
