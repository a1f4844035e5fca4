"""The controller of one robot: what its environment computes, and what it needs and refuses."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fbid_gym.environments import ENVIRONMENTS
from fbid_gym.errors import (
    FbidError,
    InvalidValueError,
    NonFiniteError,
    PolicyFileError,
    ShapeError,
    UnknownOptionError,
)
from fbid_gym.policy import Policy
from fbid_gym.quantities import RobotState
from fbid_gym.runtime import SENSORS, Controller
from tests.batches import started

ROOT = Path(__file__).resolve().parents[2]
COMMAND = (0.4, 0.1, 0.3)
SHIPPED = (
    "QuadrupedWalk-v0/base_acceleration",
    "QuadrupedWalk-v0/com_wrench",
    "QuadrupedWalk-v0/joint_position_gait",
    "BipedWalk-v0/base_acceleration",
    "BipedWalk-v0/com_wrench",
    "BipedWalk-v0/joint_position_gait",
    "BipedBalance-v0/base_acceleration",
)


def sensed(state: RobotState) -> dict[str, np.ndarray]:
    """What the sensors of the only robot of a simulation read."""
    qpos, qvel = state.qpos[0], state.qvel[0]
    return {
        "position": qpos[:3],
        "orientation": qpos[3:7],
        "velocity": qvel[:3],
        "angular_velocity": qvel[3:6],
        "joint_position": qpos[7:],
        "joint_velocity": qvel[6:],
        "contact_force": state.contact_force[0],
    }


@pytest.mark.parametrize("name", SHIPPED)
def test_its_torques_are_those_of_the_environment(name, monkeypatch):
    """Pushes and all, tick by tick, through a whole episode; and again after a reset."""
    policy, seconds = Policy.load(f"shipped:{name}"), 4.0
    arguments = {**ENVIRONMENTS[policy.env_id], **policy.env_args, "episode_seconds": seconds}
    batch, controller = started(arguments, 1), Controller.load(policy, episode_seconds=seconds)
    command = COMMAND if "Walk" in name else (0.97 * batch.task.body.size,)
    checked = batch.check_command(np.squeeze(command), 1)
    taken, advance = [], batch.simulation.tick

    def tick(torque, push, effort, state):
        given = state if len(taken) % 2 else sensed(state)
        torques = controller.tick(given)
        advance(torque, push, effort, state)
        taken.append(np.abs(torques - effort.torque[0]).max())

    monkeypatch.setattr(batch.simulation, "tick", tick)
    for _ in range(2):
        batch.reset(np.arange(1), checked)
        controller.reset()
        controller.set_command(*command)
        for _ in range(batch.num_steps):
            step = batch.step(policy(batch.observation()))
            if step.terminated[0]:
                break
    assert len(taken) > seconds * batch.rates.control
    assert max(taken) < 1e-9
