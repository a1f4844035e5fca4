"""The centroidal momentum and its matrix, against MuJoCo at random states with velocity.

The propositions of [G15] are tested on these terms, from both providers, in
`tests/eval/papers/garofalo2015/test_decoupled_dynamics.py`.
"""

import mujoco
import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.dynamics import MuJoCoDynamics, centroidal_terms
from fbid_gym.errors import ShapeError

EXACT = 1e-9
COUNT = 6
RANDOM = (4, 8)  # seeds of random trees with slides, joint offsets and tilted gravity
RANDOM_FEET = {"flat": [f"corner{index}" for index in range(4)], "ball": ["ball"]}


@pytest.fixture(scope="module", params=[*robots.ROBOTS, *RANDOM])
def robot(request, random_mjcf):
    if isinstance(request.param, str):
        return robots.load(request.param)
    return robots.Robot.from_mjcf(random_mjcf(request.param), RANDOM_FEET)


def assert_close(actual, expected):
    """Equal to 1e-9 of the largest entry expected."""
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=EXACT * np.abs(expected).max())


def test_momentum_is_that_of_the_bodies(robot, random_states):
    qpos, velocity = random_states(robot.model, COUNT)
    body = centroidal_terms(MuJoCoDynamics(robot).terms(qpos, velocity), velocity)
    data, model = mujoco.MjData(robot.model), robot.model
    for row in range(COUNT):
        data.qpos[:], data.qvel[:] = qpos[row], velocity[row]
        mujoco.mj_forward(model, data)
        com, momentum = data.subtree_com[robot.base_body], np.zeros(6)
        twist = np.zeros(6)
        for link in np.flatnonzero(model.body_rootid == robot.base_body):
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, link, twist, 0)
            axes, linear = data.ximat[link].reshape(3, 3), model.body_mass[link] * twist[3:]
            momentum[:3] += linear
            momentum[3:] += np.cross(data.xipos[link] - com, linear)
            momentum[3:] += axes @ (model.body_inertia[link] * (axes.T @ twist[:3]))
        assert_close(body.momentum[row], momentum)
    np.testing.assert_allclose(body.mass, robot.mass, rtol=EXACT)


def test_eq_5_linear_rows_are_mass_times_jacobian_of_the_com(robot, random_states):
    qpos, velocity = random_states(robot.model, COUNT)
    body = centroidal_terms(MuJoCoDynamics(robot).terms(qpos, velocity), velocity)
    data, jacobian = mujoco.MjData(robot.model), np.zeros((3, robot.nv))
    for row in range(COUNT):
        data.qpos[:] = qpos[row]
        mujoco.mj_forward(robot.model, data)
        mujoco.mj_jacSubtreeCom(robot.model, data, jacobian, robot.base_body)
        assert_close(body.matrix[row, :3], robot.mass * jacobian)


def test_what_belongs_to_other_robots_is_refused():
    robot = robots.load("quadruped")
    velocity = np.zeros((4, robot.nv))
    terms = MuJoCoDynamics(robot).terms(np.tile(robot.home_qpos, (4, 1)), velocity)
    for name in ("mass_matrix", "base_position", "world_from_base", "com"):
        one_robots = terms._replace(**{name: getattr(terms, name)[:1]})
        with pytest.raises(ShapeError, match=f"{name} has shape .* Expected"):
            centroidal_terms(one_robots, velocity)
    for wrong in (velocity[0], velocity[:, :5], velocity[:2]):
        with pytest.raises(ShapeError, match="has shape .* Expected"):
            centroidal_terms(terms, wrong)
