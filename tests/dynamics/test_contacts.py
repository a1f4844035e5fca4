"""Contact points against MuJoCo's own Jacobians, and fewer rows against all of them."""

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import (
    contact_geometry,
    point_jacobian,
    point_positions,
    point_velocities,
    reduced_contacts,
)
from fbid_gym.errors import ShapeError
from tests.dynamics.models import random_mjcf, random_states, rate, robot_called
from tests.postures import point_jacobians, points, posed

LINE_FEET = {"edge": ["corner0", "corner1"], "ball": ["ball"]}


@pytest.fixture(scope="module", params=[*robots.ROBOTS, 3, "line"])
def robot(request):
    if request.param == "line":
        return robots.Robot.from_mjcf(random_mjcf(3), LINE_FEET)
    return robot_called(request.param)


@pytest.fixture(scope="module")
def geometry(robot):
    return contact_geometry(robot)


def mujoco_points(robot, qpos, qvel):
    """Positions (P, 3), velocities (P, 3) and Jacobian (3 P, nv) of the contact points."""
    data = posed(robot, qpos)
    jacobian = point_jacobians(robot, data)
    return points(robot, data), jacobian @ qvel, jacobian.reshape(-1, robot.nv)


def test_points_are_where_mujoco_has_them_and_move_alike(robot, geometry):
    qpos, qvel = random_states(robot.model, 4)
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    positions, velocities = point_positions(geometry, terms), point_velocities(geometry, terms)
    jacobian, _ = point_jacobian(geometry, terms)
    for index in range(len(qpos)):
        expected = mujoco_points(robot, qpos[index], qvel[index])
        np.testing.assert_allclose(positions[index], expected[0], atol=1e-12)
        np.testing.assert_allclose(velocities[index], expected[1], atol=1e-11)
        np.testing.assert_allclose(jacobian[index], expected[2], atol=1e-12)


def test_point_bias_is_the_rate_of_point_velocity_at_constant_velocity(robot, geometry):
    qpos, qvel = random_states(robot.model, 3, seed=1)
    _, bias = point_jacobian(geometry, MuJoCoDynamics(robot).terms(qpos, qvel))
    for index in range(len(qpos)):
        # The lowered point is found anew at every instant: a sphere rolls.
        speed = lambda *state: mujoco_points(robot, *state)[1].ravel()  # noqa: E731
        expected = rate(robot, qpos[index], qvel[index], speed)
        assert np.abs(expected).max() > 0.1
        np.testing.assert_allclose(bias[index], expected, rtol=1e-6, atol=1e-6)


@pytest.fixture(scope="module")
def subsets(robot, geometry):
    """Every subset of the contact points, each at a random state of its own."""
    num_points = geometry.num_points
    active = (np.arange(2**num_points)[:, None] >> np.arange(num_points) & 1).astype(bool)
    terms = MuJoCoDynamics(robot).terms(*random_states(robot.model, len(active), seed=2))
    jacobian, bias = point_jacobian(geometry, terms)
    rows = np.repeat(active, 3, axis=1)
    return active, terms, jacobian * rows[:, :, None], bias * rows


def test_reduced_rows_stand_for_the_active_points(robot, geometry, subsets):
    active, terms, jacobian, bias = subsets
    reduced = reduced_contacts(geometry, terms, active)
    rows, point_map = reduced.jacobian, reduced.point_map
    assert rows.shape[1] == geometry.motion.shape[0] * geometry.motion.shape[2]
    np.testing.assert_allclose(rows.mT @ rows, jacobian.mT @ jacobian, atol=1e-10)
    ranks = (np.linalg.matrix_rank(matrix, rtol=1e-9) for matrix in (rows, jacobian))
    np.testing.assert_array_equal(*ranks)
    # One point of a foot fixes 3 directions, two fix 5, more fix 6; the other rows are zero.
    rank, used = np.array([0, 3, 5, 6, 6]), np.abs(rows).max(axis=2) > 1e-9
    feet = [active[:, geometry.foot_of_point == foot].sum(axis=1) for foot in range(robot.num_feet)]
    np.testing.assert_array_equal(used.sum(axis=1), rank[feet].sum(axis=0))
    # Point forces act through the point map, which is orthonormal where it is not zero: the
    # smallest row forces are the smallest point forces.
    np.testing.assert_allclose(point_map.mT @ rows, jacobian, atol=1e-11)
    idle = np.repeat(~active, 3, axis=1)
    assert np.abs(point_map.swapaxes(1, 2)[idle]).max() < 1e-15
    gram = point_map @ point_map.mT
    np.testing.assert_allclose(gram, used[:, :, None] * np.eye(gram.shape[1]), atol=1e-12)
    # The bias is that part of the points' which rows can see.
    np.testing.assert_allclose(reduced.bias, np.matvec(point_map, bias), atol=1e-9)


def test_all_points_at_once_is_the_full_subset(robot, geometry):
    """Without a mask the rows are those of all points, and so is the bias while the feet stand."""
    qpos, qvel = random_states(robot.model, 5, seed=3)
    dynamics = MuJoCoDynamics(robot)
    jacobian, _ = point_jacobian(geometry, dynamics.terms(qpos, qvel))
    # A velocity that moves no contact point.
    qvel = qvel - np.matvec(np.linalg.pinv(jacobian, rcond=1e-9), np.matvec(jacobian, qvel))
    assert np.abs(qvel).max() > 0.5
    terms = dynamics.terms(qpos, qvel)
    every = np.ones((5, geometry.num_points), bool)
    masked, free = reduced_contacts(geometry, terms, every), reduced_contacts(geometry, terms)
    np.testing.assert_allclose(free.jacobian, masked.jacobian, atol=1e-14)
    np.testing.assert_allclose(free.point_map, masked.point_map, atol=1e-14)
    np.testing.assert_allclose(free.bias, masked.bias, atol=1e-9)


def test_a_mask_of_another_shape_is_an_error(robot, geometry):
    terms = MuJoCoDynamics(robot).terms(*random_states(robot.model, 2))
    points = geometry.num_points
    with pytest.raises(ShapeError, match=rf"active has shape \(2, 1\). Expected \(2, {points}\)"):
        reduced_contacts(geometry, terms, np.ones((2, 1), bool))
