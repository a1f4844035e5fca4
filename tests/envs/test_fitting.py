"""A policy of bodies acts on any robot with as many feet; where one cannot, it is said in words."""

import numpy as np
import pytest

from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.fitting import check_fits
from fbid_gym.envs.verdict import by_policy
from fbid_gym.errors import PolicyFileError
from fbid_gym.policy import Policy
from fbid_gym.robots import Robot, load
from fbid_gym.runtime.config import EnvConfig
from tests.dogs import dog
from tests.eval.conftest import constant_policy

ENV = "fbid_gym/QuadrupedWalk-v0"
WALK = {"robot": "go1", "task": "walk", "physics_hz": 250, "control_hz": 250}
BODY = {"action_layer": "base_acceleration", "observation": "body"}


def made(robot: Robot, **env_args: str) -> EnvBatch:
    return EnvBatch(EnvConfig.of(WALK | env_args | {"robot": robot}), 1)


def policy_of(**env_args: str) -> Policy:
    """One that learnt with go1, of zeros."""
    batch = made(load("go1"), **env_args)
    size = np.zeros(len(batch.action_names))
    return constant_policy(ENV, batch.observation().shape[1], size, env_args=env_args)


def check(policy: Policy, robot: Robot) -> None:
    batch = made(robot, **policy.env_args)
    check_fits(policy, robot, batch.observation().shape[1], len(batch.action_names))


@pytest.mark.parametrize("joints", [8, 12, 18])
def test_a_policy_of_bodies_acts_on_any_four_feet(joints):
    robot = dog(rolls=joints > 8, neck=max(joints - 12, 0))
    assert robot.num_joints == joints
    check(policy_of(**BODY), robot)


def test_what_does_not_fit_is_said():
    six, two = load("zoo:hexapod:0"), load("biped")
    for robot in (six, two):
        with pytest.raises(PolicyFileError, match=f"acts on 4 feet, and {robot.name} has"):
            check_fits(policy_of(**BODY), robot, 7, 7)
    small = dog(rolls=False)
    sees = policy_of(action_layer="base_acceleration")
    with pytest.raises(PolicyFileError, match="sees 12 joints, and dog has 8.*observation='body'"):
        check(sees, small)
    moves = policy_of(action_layer="joint_position", observation="body")
    with pytest.raises(PolicyFileError, match="moves 12 joints, and .*0 has 16.*moves the body"):
        check(moves, load("zoo:quadruped:0"))
    with pytest.raises(PolicyFileError, match="sees 12 joints, and dog has 8"):
        by_policy(small, sees)


def test_a_verdict_by_a_policy_is_beside_the_zero_action():
    """Which this one is, so both do the same."""
    said = by_policy(load("go1"), policy_of(**BODY))
    assert said.startswith("Up to the end in QuadrupedWalk-v0: the policy 100%, with 9")
    policy, zero = said.partition(": ")[2].split("; ")
    assert policy.removeprefix("the policy ") == zero.partition("acceleration ")[2].rstrip(".")
