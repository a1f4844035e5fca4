"""Layers that walk with their joints."""

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.actions import make_layer
from fbid_gym.actions.gains import default_gains
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.motions.target import MotionKind, planned_kind
from tests.batches import Watched, started, upright

HZ = 250
JOINTS = ["joint_position_feedforward", "joint_acceleration", "joint_position"]
WALKERS = [("quadruped", JOINTS[0])]
WALKERS += [("go1", layer) for layer in (*JOINTS, "task_space_position")]


def walking(robot, layer, count, **options):
    """Robots that walk for five seconds, each to its own commands."""
    arguments = {"robot": robot, "action_layer": layer, "episode_seconds": 5.0, **options}
    return started(ENVIRONMENTS["fbid_gym/QuadrupedWalk-v0"] | arguments, count)


@pytest.mark.parametrize("robot, layer", WALKERS)
def test_the_zero_action_walks(robot, layer):
    """Robots on point feet, five seconds, whatever is commanded."""
    upright(walking(robot, layer, 4), 5.0)


def staying(batch):
    """How many robots stay up through an episode by the zero action."""
    standing, zero = np.ones(batch.num_envs, bool), np.zeros((1, len(batch.action_names)))
    for _ in range(batch.num_steps):
        standing &= ~batch.step(zero.repeat(batch.num_envs, axis=0)).terminated
    return standing.sum()


@pytest.mark.parametrize("layer", ["joint_position", "task_space_position"])
def test_ankles_keep_most_bipeds_up(layer):
    """Without a pendulum's force all fall within three seconds."""
    biped = ENVIRONMENTS["fbid_gym/BipedWalk-v0"] | {"action_layer": layer, "episode_seconds": 4.0}
    assert staying(started(biped, 8)) >= 6
    if layer == "joint_position":
        assert staying(started(biped | {"layer_options": {"pendulum": False}}, 8)) <= 1


@pytest.mark.slow
def test_quick_steps_have_stiffer_joints():
    """By as much as they are quicker; as soft as in a slow walk a biped falls in a brisk one."""
    brisk = ENVIRONMENTS["fbid_gym/BipedWalk-v1"] | {"robot": "zoo:biped:5"}
    brisk |= {"action_layer": "joint_position", "episode_seconds": 16.0}
    slow, quick = started(brisk | {"gait": "walk"}, 1), started(brisk, 16)
    slowly, quickly = (batch.layer.natural_frequency for batch in (slow, quick))
    lasts = [batch.task.derived["gait_period"] for batch in (slow, quick)]
    np.testing.assert_allclose(quickly / slowly, lasts[0] / lasts[1])
    soft = started(brisk | {"layer_options": {"natural_frequency": slowly}}, 16)
    assert staying(quick) >= staying(soft) + 8


def test_torques_of_joint_pd_go_through_lift_off():
    """A foot that lifts has handed over before what it led the body by; the weight only then."""
    batch = walking("go1", "joint_position", 4, layer_options={"pendulum": False})
    batch.loop.layer = seen = Watched(batch.layer)
    for _ in range(batch.num_steps):
        batch.step(np.zeros((4, len(batch.action_names))))
    stood = np.array(seen.planted)
    change = np.abs(np.diff(seen.torques, axis=0)).reshape(len(stood) - 1, 4, 4, 3).max(axis=3)
    lifts, stands = stood[:-1] & ~stood[1:], stood[:-1] & stood[1:]
    assert lifts.sum() > 100
    assert np.median(change[lifts]) < 2.0 * np.median(change[stands])


@pytest.mark.parametrize("name", ["go1", "biped"])
def test_feedback_on_a_gait_is_as_stiff_as_its_body_is_held(name):
    """In units of the rate at which the robot falls as it walks."""
    robot, made = robots.load(name), {}
    feedforward = "joint_position_feedforward"
    for omega in (3.0, 6.0):
        kind = MotionKind(True, omega)
        made[omega], _ = make_layer(feedforward, robot, HZ, kind)
        gains = default_gains(robot, kind)
        layer, _ = make_layer("joint_acceleration", robot, HZ, kind)
        assert layer.stiffness == pytest.approx(gains.swing)
        held = np.sqrt(max(gains.height, gains.rotation)) / (2.0 * np.pi)
        if robot.has_soles:  # stiffer ankles would tip the soles
            held = make_layer(feedforward, robot, HZ, planned_kind(robot))[0].natural_frequency
        assert made[omega].natural_frequency == pytest.approx(held)
