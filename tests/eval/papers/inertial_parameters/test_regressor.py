"""The regressor against MuJoCo's M and h, at nonzero velocity, for any parameters."""

import numpy as np
import pytest

from eval.papers.inertial_parameters.inertia import (
    parameters_of_pseudo_inertia,
    pseudo_inertia,
    with_parameters,
)
from eval.papers.inertial_parameters.regressor import InertialRegressor
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.robots import ROBOTS
from tests.dynamics.models import random_states, relative_error, robot_called


@pytest.fixture(scope="module", params=[*ROBOTS, "gymnasium humanoid", 1, 2, 3, 4, 5, 6])
def robot(request):
    # Welded bodies, several joints on a body, slides, armature also on the free joint.
    return robot_called(request.param)


@pytest.fixture
def motion(robot, rng):
    """States far from rest, and accelerations."""
    qpos, qvel = random_states(robot.model, 4)
    return qpos, qvel, 5.0 * rng.normal(size=qvel.shape)


def force(robot, qpos, qvel, qacc):
    """M a + h by MuJoCo."""
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    return np.matvec(terms.mass_matrix, qacc) + terms.bias


def test_regressor_knows_no_parameters(robot, motion, rng):
    regressor = InertialRegressor(robot)
    matrix = pseudo_inertia(regressor.parameters())
    deform = np.eye(4) + 0.2 * rng.normal(size=matrix.shape)
    parameters = parameters_of_pseudo_inertia(deform @ matrix @ deform.mT)
    other = with_parameters(robot, regressor.bodies, parameters)
    actual = regressor.rows(*motion) @ parameters.ravel() + regressor.armature * motion[2]
    for row, expected in zip(actual, force(other, *motion), strict=True):
        assert relative_error(row, expected) < 1e-9
    # And the regressor of the other robot is the same.
    np.testing.assert_array_equal(InertialRegressor(other).rows(*motion), regressor.rows(*motion))


def test_quaternion_need_not_be_normalised(robot, motion):
    qpos, qvel, qacc = motion
    longer = qpos.copy()
    longer[:, 3:7] *= 1.7
    regressor = InertialRegressor(robot)
    found = regressor.rows(longer, qvel, qacc)
    np.testing.assert_allclose(found, regressor.rows(*motion), atol=1e-9)
