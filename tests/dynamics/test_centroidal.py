"""The centroidal momentum and its matrix, against MuJoCo at random states with velocity.

All rows of the matrix against Pinocchio's, and the propositions of [G15], are in
`tests/eval/papers/garofalo2015/test_decoupled_dynamics.py`.
"""

import mujoco
import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.dynamics import MuJoCoDynamics, centroidal_terms
from fbid_gym.errors import ShapeError
from tests.dynamics.models import assert_close, random_states, robot_called
from tests.postures import posed

COUNT = 6
RANDOM = (4, 8)  # seeds of random trees with slides, joint offsets and tilted gravity


@pytest.fixture(scope="module", params=[*robots.ROBOTS, *RANDOM])
def robot(request):
    return robot_called(request.param)


def test_momentum_is_that_of_the_bodies(robot):
    qpos, velocity = random_states(robot.model, COUNT)
    body = centroidal_terms(MuJoCoDynamics(robot).terms(qpos, velocity), velocity)
    model = robot.model
    for row in range(COUNT):
        data = posed(robot, qpos[row], velocity[row])
        com, momentum = data.subtree_com[robot.base_body], np.zeros(6)
        twist = np.zeros(6)
        for link in np.flatnonzero(model.body_rootid == robot.base_body):
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, link, twist, 0)
            axes, linear = data.ximat[link].reshape(3, 3), model.body_mass[link] * twist[3:]
            momentum[:3] += linear
            momentum[3:] += np.cross(data.xipos[link] - com, linear)
            momentum[3:] += axes @ (model.body_inertia[link] * (axes.T @ twist[:3]))
        assert_close(body.momentum[row], momentum)
    np.testing.assert_allclose(body.mass, robot.mass, rtol=1e-9)


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
