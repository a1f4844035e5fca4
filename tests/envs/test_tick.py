"""A control tick in two compiled calls does what its parts do, and finds who is lost."""

import numpy as np
import pytest

from fbid_gym.envs.simulation import MAX_SPEED, Simulation
from fbid_gym.quantities import RobotState
from fbid_gym.robots import ROBOTS, load
from fbid_gym.runtime.effort import Effort
from fbid_gym.runtime.rates import Rates

COUNT = 4


def standing(name: str, count: int = COUNT) -> Simulation:
    robot = load(name)
    simulation = Simulation(robot, count, Rates())
    home = np.tile(robot.home_qpos, (count, 1))
    simulation.place(np.arange(count), home, np.zeros((count, robot.nv)))
    return simulation


def state_of(simulation: Simulation) -> RobotState:
    own = simulation.qpos.copy(), simulation.qvel.copy()
    return RobotState(*own, simulation.contact_force, np.full(simulation.num_robots, 7))


@pytest.mark.parametrize("name", ROBOTS)
def test_a_tick_is_a_push_and_a_step_under_limited_torques(name, rng):
    ours, theirs = standing(name), standing(name)
    robot, state = ours.robot, state_of(ours)
    effort = Effort.none(COUNT, robot.num_joints)
    square, power = np.zeros(COUNT), np.zeros(COUNT)
    for tick in range(5):
        wanted = 1.5 * rng.normal(size=(COUNT, robot.num_joints)) * robot.torque_limit
        push = rng.normal(size=(COUNT, 3)) * robot.weight
        ours.tick(wanted, push, effort, state)

        torque = np.clip(wanted, -robot.torque_limit, robot.torque_limit)
        theirs.push(push)
        theirs.step(torque)
        square += np.square(torque).sum(axis=1)
        power += np.abs(torque * theirs.qvel[:, 6:]).sum(axis=1)
        for found, expected in (
            (effort.torque, torque),
            (effort.saturation, (np.abs(wanted) >= robot.torque_limit).mean(axis=1)),
            (state.qpos, theirs.qpos),
            (state.qvel, theirs.qvel),
            (state.contact_force, theirs.contact_force),
            (state.tick, tick + 8),
            (ours.batch.state, theirs.batch.state),
        ):
            np.testing.assert_array_equal(found, expected)
    np.testing.assert_allclose(effort.torque_square, square, rtol=1e-12)
    np.testing.assert_allclose(effort.power, power, rtol=1e-12)
    assert not effort.lost.any() and not ours.diverged().any()


def test_torques_that_are_no_numbers_lose_one_robot(rng):
    ours, theirs = standing("biped"), standing("biped")
    limit, state = ours.robot.torque_limit, state_of(ours)
    effort, nothing = Effort.none(COUNT, len(limit)), np.zeros((COUNT, 3))
    wanted = rng.uniform(-0.1, 0.1, (COUNT, len(limit))) * limit
    broken = wanted.copy()
    broken[1, 3] = np.nan
    broken[2, 5] = np.inf  # only too large
    ours.tick(broken, nothing, effort, state)
    wanted[1], wanted[2, 5] = 0.0, limit[5]
    theirs.step(wanted)
    np.testing.assert_array_equal(effort.torque, wanted)
    np.testing.assert_array_equal(state.qpos, theirs.qpos)
    assert effort.lost.tolist() == [False, True, False, False]
    ours.tick(wanted, nothing, effort, state)
    assert effort.lost.tolist() == [False, True, False, False]  # until the step is over
    effort.begin()
    ours.tick(wanted, nothing, effort, state)
    assert not effort.lost.any()


def test_who_has_diverged():
    simulation = standing("biped")
    simulation.qvel[0, -1], simulation.qvel[1, 2] = 0.99 * MAX_SPEED, -1.01 * MAX_SPEED
    simulation.qvel[2, 6] = np.nan
    assert simulation.diverged().tolist() == [False, True, True, False]
