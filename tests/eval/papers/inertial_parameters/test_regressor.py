"""The regressor against MuJoCo's M and h, at nonzero velocity, for any parameters."""

import numpy as np
import pytest

from eval.papers.inertial_parameters.inertia import (
    parameters_of_pseudo_inertia,
    pseudo_inertia,
    with_parameters,
)
from eval.papers.inertial_parameters.regressor import InertialRegressor
from fbid_gym import robots
from fbid_gym.dynamics import MuJoCoDynamics

RANDOM_FEET = {"flat": [f"corner{index}" for index in range(4)], "ball": ["ball"]}
EXACT = 1e-9


@pytest.fixture(scope="module", params=[*robots.ROBOTS, "humanoid", 1, 2, 3, 4, 5, 6])
def robot(request, tmp_path_factory, random_mjcf, gymnasium_assets):
    if request.param == "humanoid":
        path = gymnasium_assets / "humanoid.xml"
        return robots.Robot.from_mjcf(path, ["left_foot", "right_foot"])
    if isinstance(request.param, int):
        # Welded bodies, several joints on a body, slides, armature also on the free joint.
        path = tmp_path_factory.mktemp("robots") / f"random{request.param}.xml"
        path.write_text(random_mjcf(request.param))
        return robots.Robot.from_mjcf(path, RANDOM_FEET)
    return robots.load(request.param)


@pytest.fixture
def motion(robot, random_states, rng):
    """States far from rest, and accelerations."""
    qpos, qvel = random_states(robot.model, 4)
    return qpos, qvel, 5.0 * rng.normal(size=qvel.shape)


def force(robot, qpos, qvel, qacc):
    """M a + h by MuJoCo."""
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    return np.matvec(terms.mass_matrix, qacc) + terms.bias


def assert_rows_match(actual, expected, relative_error):
    for row, reference in zip(actual, expected, strict=True):
        assert relative_error(row, reference) < EXACT


def test_regressor_knows_no_parameters(robot, motion, rng, relative_error):
    regressor = InertialRegressor(robot)
    matrix = pseudo_inertia(regressor.parameters())
    deform = np.eye(4) + 0.2 * rng.normal(size=matrix.shape)
    parameters = parameters_of_pseudo_inertia(deform @ matrix @ deform.mT)
    other = with_parameters(robot, regressor.bodies, parameters)
    actual = regressor.rows(*motion) @ parameters.ravel() + regressor.armature * motion[2]
    assert_rows_match(actual, force(other, *motion), relative_error)
    # And the regressor of the other robot is the same.
    np.testing.assert_array_equal(InertialRegressor(other).rows(*motion), regressor.rows(*motion))


def test_quaternion_need_not_be_normalised(robot, motion):
    qpos, qvel, qacc = motion
    longer = qpos.copy()
    longer[:, 3:7] *= 1.7
    regressor = InertialRegressor(robot)
    np.testing.assert_allclose(
        regressor.rows(longer, qvel, qacc), regressor.rows(qpos, qvel, qacc), atol=1e-9
    )
