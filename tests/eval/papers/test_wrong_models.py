"""Models with errors, and robots that believe in them."""

import numpy as np

from eval.papers.inertial_parameters.regressor import InertialRegressor
from eval.papers.trial import RATES
from eval.papers.wrong_models import believing, wrong_model
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.envs.simulation import Simulation


def test_wrong_models_are_wrong_as_said(robot, rng):
    true = InertialRegressor(robot).parameters()
    factors, shifts = [], []
    for _ in range(20):
        wrong = InertialRegressor(wrong_model(robot, 0.3, rng)).parameters()
        factors.append(wrong[:, 0] / true[:, 0])
        shifts.append(wrong[:, 1:4] / wrong[:, :1] - true[:, 1:4] / true[:, :1])
    factors, shifts = np.array(factors), np.array(shifts)
    assert 0.7 <= factors.min() < 0.75 and 1.25 < factors.max() <= 1.3
    # The thigh is a cylinder of 0.385 m and 0.14 m across, its frame along its axes.
    half = np.sqrt(3.0) * np.array([0.07 / 2, 0.07 / 2, 0.385 / np.sqrt(12.0)])
    worst = np.abs(shifts[:, 1]).max(axis=0)
    assert (worst <= 0.3 * half * 1.02).all() and (worst > 0.2 * half).all()
    same = InertialRegressor(wrong_model(robot, 1e-12, rng)).parameters()
    np.testing.assert_allclose(same, true, rtol=1e-9, atol=1e-11)


def test_each_robot_believes_its_own_model(robot, rng):
    models = [wrong_model(robot, 0.3, rng) for _ in range(3)]
    simulation = Simulation(robot, 3, RATES)
    simulation.qpos[:] = robot.home_qpos
    simulation.qvel[:] = rng.normal(size=simulation.qvel.shape)
    terms = believing(models)(simulation)()
    for index, model in enumerate(models):
        state = simulation.qpos[index : index + 1], simulation.qvel[index : index + 1]
        expected = MuJoCoDynamics(model).terms(*state)
        for name in ("mass_matrix", "bias", "com", "foot_jacobian"):
            found = getattr(terms, name)[index]
            np.testing.assert_allclose(found, getattr(expected, name)[0], atol=1e-9)
