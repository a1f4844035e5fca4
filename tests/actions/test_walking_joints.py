"""Layers that walk with their joints."""

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.actions import make_walking_layer, walking_options
from fbid_gym.actions.contact_options import WalkingContact
from fbid_gym.actions.joint_position_feedforward import JointPositionFeedforward
from fbid_gym.actions.walking_joints import body_frequency, swing_frequency
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.config import EnvConfig
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.options import options_of

HZ = 250


def walking(robot, layer, count):
    """Robots that walk for five seconds, each to its own commands."""
    arguments = {"robot": robot, "action_layer": layer, "episode_seconds": 5.0}
    batch = EnvBatch(EnvConfig.of(ENVIRONMENTS["fbid_gym/QuadrupedWalk-v0"] | arguments), count)
    for env in range(count):
        batch.seed(env, np.random.default_rng(env))
    batch.reset(np.arange(count))
    return batch, np.zeros((count, len(batch.action_names)))


@pytest.mark.parametrize(
    "robot, layer",
    [
        ("go1", "joint_position_feedforward"),
        ("quadruped", "joint_position_feedforward"),
        ("go1", "joint_acceleration"),
        ("go1", "joint_position"),
    ],
)
def test_the_zero_action_walks(robot, layer):
    """Robots on point feet, five seconds, whatever is commanded."""
    batch, zero = walking(robot, layer, 4)
    for _ in range(batch.num_steps):
        assert not batch.step(zero).terminated.any()


def test_torques_of_joint_pd_go_through_lift_off():
    """A foot that lifts has handed over before what it led the body by."""
    batch, zero = walking("go1", "joint_position", 4)
    planted, torque, inner = [], [], batch.layer

    class Watched:
        def __getattr__(self, name):
            return getattr(inner, name)

        def torque(self, action, state, reference, *others):
            said = inner.torque(action, state, reference, *others)
            planted.append(reference.planted.copy())
            torque.append(said.copy())
            return said

    batch.layer = Watched()
    for _ in range(batch.num_steps):
        batch.step(zero)
    stood = np.array(planted)
    change = np.abs(np.diff(torque, axis=0)).reshape(len(stood) - 1, 4, 4, 3).max(axis=3)
    lifts, stands = stood[:-1] & ~stood[1:], stood[:-1] & stood[1:]
    assert lifts.sum() > 100
    assert np.median(change[lifts]) < 2.0 * np.median(change[stands])


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


MODEL_BASED = ("joint_position_feedforward", "joint_acceleration")


@pytest.mark.parametrize("name", MODEL_BASED)
def test_joint_layers_take_the_contacts_as_those_of_the_body_do(name):
    """The same options, with the same defaults and the same meaning."""
    shared = options_of(WalkingContact).keys()
    own, others = walking_options(name), walking_options("base_acceleration")
    assert {key: own[key] for key in shared} == {key: others[key] for key in shared}
    robot, given = robots.load("biped"), {"contact_limits": "none", "friction": 0.3}
    for options in ({}, given, {"contact_ramp": 0.02}):
        laws = [
            layer.law if other else layer.inner.law
            for other, layer in (
                (key == "base_acceleration", make_walking_layer(key, robot, HZ, 4.0, options)[0])
                for key in (name, "base_acceleration")
            )
        ]
        assert laws[0].limited == laws[1].limited == ("contact_limits" not in options)
        assert laws[0].ramp == laws[1].ramp
        np.testing.assert_array_equal(
            laws[0].constants.limits[0, 0], laws[1].constants.limits[0, 0]
        )
