"""Layers that walk with their joints."""

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.actions import make_walking_layer
from fbid_gym.actions.joint_position_feedforward import JointPositionFeedforward
from fbid_gym.actions.walking_joints import body_frequency, swing_frequency
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.env_batch import EnvBatch

HZ = 250


@pytest.mark.parametrize(
    "robot, layer",
    [
        ("go1", "joint_position_feedforward"),
        ("quadruped", "joint_position_feedforward"),
        ("go1", "joint_acceleration"),
    ],
)
def test_the_zero_action_walks(robot, layer):
    """Robots on point feet, five seconds, whatever is commanded."""
    count = 4
    arguments = {"robot": robot, "action_layer": layer, "episode_seconds": 5.0}
    batch = EnvBatch(EnvConfig.of(ENVIRONMENTS["fbid_gym/QuadrupedWalk-v0"] | arguments), count)
    for env in range(count):
        batch.seed(env, np.random.default_rng(env))
    batch.reset(np.arange(count))
    zero = np.zeros((count, len(batch.action_names)))
    for _ in range(batch.num_steps):
        assert not batch.step(zero).terminated.any()


@pytest.mark.parametrize("name", ["go1", "biped"])
def test_feedback_on_a_gait_is_as_stiff_as_its_tasks_are(name):
    """In units of the rate at which the robot falls."""
    robot = robots.load(name)
    soft, stiff = (body_frequency(robot, omega) for omega in (1.0, 2.0))
    assert stiff == pytest.approx(2.0 * soft)
    for omega in (3.0, 6.0):
        layer, _ = make_walking_layer("joint_position_feedforward", robot, HZ, omega)
        expected = body_frequency(robot, omega)
        if robot.num_points > robot.num_feet:  # soft ankles do not tip the soles
            expected = JointPositionFeedforward.of(robot, HZ).natural_frequency
        assert layer.inner.natural_frequency == pytest.approx(expected)
        layer, _ = make_walking_layer("joint_acceleration", robot, HZ, omega)
        stiffness = (2.0 * np.pi * swing_frequency(robot, omega)) ** 2
        assert layer.inner.gains.stiffness == pytest.approx(stiffness)
