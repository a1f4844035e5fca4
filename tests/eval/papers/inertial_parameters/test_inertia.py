"""Inertial parameters: against point masses, and against MuJoCo and Pinocchio."""

import mujoco
import numpy as np
import pytest

from eval.papers.inertial_parameters.inertia import (
    body_parameters,
    consistency,
    parameters_of_pseudo_inertia,
    pseudo_inertia,
    with_parameters,
)
from fbid_gym import robots
from fbid_gym.dynamics import MuJoCoDynamics, PinocchioDynamics
from fbid_gym.errors import InvalidValueError
from tests.dynamics.models import random_states, relative_error, robot_called


def parameters_of_points(mass, points):
    """The ten parameters of point masses (P,) at (P, 3), from their definitions."""
    squares = np.vecdot(points, points)[:, None, None] * np.eye(3)
    tensor = np.tensordot(mass, squares - points[:, :, None] * points[:, None], 1)
    upper = tensor[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    return np.concatenate([[mass.sum()], mass @ points, upper])


def bodies_with_mass(robot):
    member = robot.model.body_rootid == robot.base_body
    return np.flatnonzero(member & (robot.model.body_mass > 0))


def changed(robot, rng, size=0.2):
    """The robot with every body deformed: masses, centres of mass and inertias of its own."""
    bodies = bodies_with_mass(robot)
    matrix = pseudo_inertia(body_parameters(robot.model, bodies))
    deform = np.eye(4) + size * rng.normal(size=(len(bodies), 4, 4))
    parameters = parameters_of_pseudo_inertia(deform @ matrix @ deform.mT)
    return with_parameters(robot, bodies, parameters), bodies, parameters


def test_pseudo_inertia_of_point_masses(rng):
    mass, points = rng.uniform(0.1, 2.0, 6), rng.normal(size=(6, 3))
    parameters = parameters_of_points(mass, points)
    homogeneous = np.concatenate([points, np.ones((6, 1))], axis=1)
    expected = homogeneous.T @ (mass[:, None] * homogeneous)
    np.testing.assert_allclose(pseudo_inertia(parameters), expected, atol=1e-12)
    np.testing.assert_allclose(parameters_of_pseudo_inertia(expected), parameters, atol=1e-12)


def test_consistency_tells_what_can_exist(rng):
    mass, points = rng.uniform(0.1, 2.0, 4), rng.normal(size=(4, 3))
    assert consistency(parameters_of_points(mass, points)) > 1e-6
    # A plate has no extent across, a ball with too much inertia about one axis cannot be.
    points[:, 2] = 0.0
    assert abs(consistency(parameters_of_points(mass, points))) < 1e-12
    ball = np.array([1.0, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1])
    assert consistency(ball) == pytest.approx(1.0)
    long = ball.copy()
    long[9] = 0.21  # more than the other two together
    assert consistency(long) < 0.0
    negative = ball.copy()
    negative[0] = -1.0
    assert consistency(negative) < 0.0
    np.testing.assert_array_equal(consistency(np.stack([ball, long])) > 0.0, [True, False])


@pytest.mark.parametrize("name", robots.ROBOTS)
def test_parameters_of_a_model_are_pinocchios(name):
    robot = robots.load(name)
    dynamics, bodies = PinocchioDynamics(robot), bodies_with_mass(robot)
    for body, parameters in zip(bodies, body_parameters(robot.model, bodies), strict=True):
        frame = dynamics.model.frames[int(body)]
        inertia = dynamics.model.inertias[frame.parentJoint]
        expected = frame.placement.actInv(inertia).toDynamicParameters()
        np.testing.assert_allclose(parameters, expected, atol=1e-12)


@pytest.mark.parametrize("name", robots.ROBOTS)
def test_a_changed_robot_has_the_parameters_it_was_given(name, rng):
    robot, bodies, parameters = changed(robots.load(name), rng)
    np.testing.assert_allclose(body_parameters(robot.model, bodies), parameters, atol=1e-12)
    assert robot.mass == pytest.approx(parameters[:, 0].sum())


def test_a_changed_robot_is_the_same_to_both_providers(rng):
    for name in robots.ROBOTS:
        robot, _, _ = changed(robots.load(name), rng)
        states = random_states(robot.model, 3)
        ours, theirs = (p(robot).terms(*states) for p in (MuJoCoDynamics, PinocchioDynamics))
        for field in ("mass_matrix", "bias", "com", "com_velocity"):
            assert relative_error(getattr(ours, field), getattr(theirs, field)) < 1e-9, field


def test_a_changed_robot_keeps_its_shape(rng):
    # The humanoid's geoms lie in its bodies' inertial frames, which move.
    original = robot_called("gymnasium humanoid")
    before = original.model.body_mass.copy()
    robot, _, _ = changed(original, rng)
    places = []
    for model in (original.model, robot.model):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        parts = data.geom_xpos, data.geom_xmat, data.site_xpos
        places.append(np.concatenate([part.ravel() for part in parts]))
    np.testing.assert_allclose(places[1], places[0], atol=1e-12)
    np.testing.assert_array_equal(original.model.body_mass, before)
    assert not np.allclose(robot.model.body_mass, before)


def test_parameters_that_no_body_has_are_refused():
    robot = robots.load("biped")
    bodies = bodies_with_mass(robot)
    parameters = body_parameters(robot.model, bodies)
    parameters[1, 0] = -2.0
    with pytest.raises(InvalidValueError, match="body 'left_thigh'.*positive definite"):
        with_parameters(robot, bodies, parameters)
