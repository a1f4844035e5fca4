"""A robot among other bodies: simulated and described as if it were alone."""

import numpy as np
import pytest

from fbid_gym.envs.simulation import Simulation
from fbid_gym.errors import RobotError
from fbid_gym.robots import load
from fbid_gym.runtime.rates import Rates

RATES = Rates(1000, 500)


def with_a_ball(robot):
    """The robot's world with a ball ten metres up."""
    spec = robot.spec.copy()
    inertial = {"ipos": [0, 0, 0], "mass": 2.0, "inertia": [0.1] * 3, "explicitinertial": True}
    body = spec.worldbody.add_body(name="ball", pos=[3, 0, 10], **inertial)
    body.add_freejoint()
    return spec.compile()


@pytest.mark.parametrize("name", ["humanoid", "quadruped"])
def test_a_distant_body_changes_nothing(name, rng):
    """Positions, forces and dynamics terms to rounding; the ball falls beside the robot."""
    robot = load(name)
    worlds = [Simulation(robot, 3, RATES), Simulation(robot, 3, RATES, world=with_a_ball(robot))]
    ids, qpos = np.arange(3), np.tile(robot.home_qpos, (3, 1))
    qpos[:, 7:] += rng.uniform(0.0, 0.01, (3, robot.num_joints)) * (robot.joint_range[:, 1] > 0.02)
    qvel = 0.1 * rng.normal(size=(3, robot.nv))
    for world in worlds:
        world.place(ids, qpos, qvel)
        assert world.qpos.shape == (3, robot.nq) and world.qvel.shape == (3, robot.nv)
    for _ in range(50):
        torque = 0.05 * rng.normal(size=(3, robot.num_joints)) * robot.torque_limit
        for world in worlds:
            world.step(torque)
    alone, among = worlds
    np.testing.assert_allclose(among.qpos, alone.qpos, atol=1e-9)
    np.testing.assert_allclose(among.contact_force, alone.contact_force, atol=1e-6 * robot.weight)
    for field, theirs in alone.terms()._asdict().items():
        ours, size = getattr(among.terms(), field), max(1.0, np.abs(theirs).max())
        np.testing.assert_allclose(ours, theirs, atol=1e-7 * size, err_msg=field)
    height = among.batch.bind("qpos")[:, robot.nq + 2]
    np.testing.assert_allclose(height, 10.0 - 0.5 * 9.81 * 0.1**2, atol=1e-3)


def test_a_world_without_the_robot_is_an_error():
    robot = load("biped")
    with pytest.raises(RobotError, match="does not begin with 'biped': its body_parentid differ"):
        Simulation(robot, 1, RATES, world=with_a_ball(load("quadruped")))
    with pytest.raises(RobotError, match=r"a copy of robot.spec with bodies added at the end"):
        Simulation(robot, 1, RATES, world=load("quadruped").model)
