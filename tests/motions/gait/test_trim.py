"""The integral of the velocity's error, which a gait adds to the command."""

import numpy as np
import pytest

from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.motions.gait.command import no_command
from fbid_gym.motions.gait.gait import gait_of
from fbid_gym.quantities import some_of
from fbid_gym.robots import load
from tests.batches import started

HZ, TIME = 250, 5.0
VELOCITY = np.array([0.1, -0.05, 0.0])  # m/s


def carried(robot, gait, errors, turn=0.7):
    """Robots that a hand carries with velocities (N, 2) beside the command, along a heading."""
    count = len(errors)
    qpos, qvel = np.tile(robot.home_qpos, (count, 1)), np.zeros((count, robot.nv))
    qpos[:, 3:7] = np.cos(0.5 * turn), 0.0, 0.0, np.sin(0.5 * turn)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    qvel[:, :2] = (VELOCITY[:2] - errors) @ axes
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    force = np.zeros((count, robot.num_points, 3))
    force[:, :, 2] = robot.weight / robot.num_points
    command = no_command(count, robot.num_feet)
    command.velocity[:] = VELOCITY
    return terms, force, command, gait.memory(terms)


@pytest.mark.parametrize("name", ["go1", "biped"])
def test_a_lasting_error_is_integrated_and_no_other(name):
    robot = load(name)
    gait = gait_of(robot, HZ, integral_time=TIME)
    speed = robot.gravity / gait.omega
    errors = speed * np.array([[0.03, -0.02], [0.05, 0.0], [0.11, -0.01]])
    terms, force, command, memory = carried(robot, gait, errors)
    integral, ticks = np.zeros((3, 2)), 0
    for _ in range(4 * HZ):
        last = memory["velocity"].copy()
        gait.advance(command, terms, force, memory)
        # On the way to the command nothing is lasting; what is greater than a push's is a push.
        short = np.abs(VELOCITY + np.hstack([integral, np.zeros((3, 1))]) - last)
        on_the_way = (short > gait.constants.agility / HZ).any(axis=1)
        counts = (np.abs(errors) < 0.1 * speed) & ~on_the_way[:, None]
        integral += counts * errors * gait.omega / TIME / HZ
        integral = np.clip(integral, -0.1 * speed, 0.1 * speed)
        np.testing.assert_allclose(memory["trim"], integral, atol=1e-9 * speed)
        ticks += on_the_way.sum()
    assert 3 < ticks < 3 * HZ
    assert integral[1, 0] == 0.1 * speed and integral[2, 0] == 0.0 != integral[2, 1]
    added = memory["velocity"][:, :2] - VELOCITY[:2]
    np.testing.assert_allclose(added, integral, atol=1e-3 * speed)
    # A robot that is to stand stands, and knows what it has to make up for when it goes on.
    command.velocity[:] = 0.0
    for _ in range(2 * HZ):
        gait.advance(command, terms, force, memory)
    assert not memory["velocity"].any()
    np.testing.assert_allclose(memory["trim"], integral, atol=1e-9 * speed)


def test_each_robot_has_its_own_as_if_it_were_alone_and_begins_without(rng):
    robot = load("go1")
    gait = gait_of(robot, HZ, integral_time=TIME)
    terms, force, command, memory = carried(robot, gait, 0.1 * rng.normal(size=(3, 2)))
    alone = {name: value[1:2].copy() for name, value in memory.items()}
    one = np.array([1])
    for _ in range(HZ):
        gait.advance(command, terms, force, memory)
        gait.advance(some_of(command, one), some_of(terms, one), force[one], alone)
    assert memory["trim"].any(axis=1).all() and not gait.memory(terms)["trim"].any()
    for name, value in alone.items():
        np.testing.assert_array_equal(memory[name][one], value, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("layer", ["base_acceleration", "joint_position"])
def test_a_load_off_the_centre_leaves_no_lasting_error(layer):
    """Nor another wrong model: by layers that know the dynamics, and those that do not."""
    still = {"command_interval": (99.0, 99.0), "command_ramp": (0.0, 0.0)}
    still |= {"push_weights": (0.0, 0.0), "randomisation": {"payload": (0.25, 0.25)}}
    still |= {"action_layer": layer, "gait": "trot"}
    asked, errors = np.array([[0.8, 0.3, 0.0], [-0.8, 0.0, 0.3], [0.0, 0.6, 0.0]]), []
    for integral_time in (0.0, TIME):
        own = still | {"integral_time": integral_time}
        batch = started(ENVIRONMENTS["fbid_gym/QuadrupedWalk-v1"] | own, 3)
        batch._plan["command"][:, 0] = asked
        zero, seconds, seen = np.zeros((3, len(batch.action_names))), 8, []
        for step in range(seconds * batch.rates.policy):
            assert not batch.step(zero).terminated.any()
            if step >= seconds * batch.rates.policy // 2:
                heading = np.exp(-1j * batch.loop.planned["heading"])
                velocity = heading * (batch.simulation.terms().com_velocity @ [1.0, 1j, 0.0])
                seen.append(velocity - asked @ [1.0, 1j, 0.0])
        errors.append(np.abs(np.mean(seen, axis=0)))
    assert (errors[0] > 0.01).all() and (errors[1] < 0.2 * errors[0]).all(), errors
