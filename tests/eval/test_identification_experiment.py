"""The data of the identification experiment, and what it promises."""

import numpy as np
import pytest

from eval.papers.experiment import Setting
from eval.papers.log import Log
from eval.papers.mistry2010 import identification
from eval.papers.mistry2010.exciting import STANCES, exciting
from eval.papers.mistry2010.identified import feedforward, feedforward_of, held_out
from eval.papers.mistry2010.measuring import Filter, believing, measured, wrong_model
from eval.papers.trial import RATES
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.identification import InertialRegressor
from fbid_gym.envs.simulation import Simulation
from fbid_gym.robots import load


@pytest.fixture(scope="module")
def robot():
    return load("biped")


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
            np.testing.assert_allclose(
                getattr(terms, name)[index], getattr(expected, name)[0], atol=1e-9
            )


def test_filter_is_exact_for_polynomials():
    time = np.arange(400) / RATES.control
    values = np.stack([1.0 + time**3, 2.0 * time**2 - time], axis=1)
    rates = np.stack([3.0 * time**2, 4.0 * time - 1.0], axis=1)
    smooth = Filter(half=20, order=3, every=7)
    kept = np.arange(20, 380, 7)
    np.testing.assert_allclose(smooth(values), values[kept], atol=1e-9)
    np.testing.assert_allclose(smooth(rates), rates[kept], atol=1e-9)
    np.testing.assert_allclose(smooth(values, 1), rates[kept], atol=1e-8)


def test_exciting_motions_keep_their_feet(robot):
    motion = exciting(robot, 8, seed=3)
    assert motion.period == 8 * RATES.control
    low, high = robot.joint_range.T
    for stance, planted in enumerate(STANCES.values()):
        qpos, qvel, qacc = (part[stance, ::20] for part in motion.states)
        assert (qpos[:, 7:] >= low).all() and (qpos[:, 7:] <= high).all()
        terms = MuJoCoDynamics(robot).terms(qpos, qvel)
        feet = np.flatnonzero(planted)
        assert np.ptp(terms.foot_position[:, feet], axis=0).max() < 1e-6
        assert np.abs(terms.foot_velocity[:, feet]).max() < 1e-6
        rate = (terms.foot_jacobian[:, feet] @ qacc[:, None, :, None])[..., 0]
        assert np.abs(rate + terms.foot_bias[:, feet]).max() < 1e-5
        over = terms.foot_position[:, feet].mean(axis=1)
        assert np.abs(terms.com - over)[:, :2].max(axis=0)[0] < 0.08
        assert np.abs(qvel[:, 6:]).max(axis=0).min() > 0.05  # every joint moves


def test_measurements_are_what_the_links_feel(robot, rng):
    ticks = 300
    time = np.arange(ticks)[:, None] / RATES.control
    qpos = np.tile(robot.home_qpos, (ticks, 1))
    qpos[:, 7:] += 0.1 * time
    qvel = np.zeros((ticks, robot.nv))
    qvel[:, 6:] = 0.1 + time
    torque = 5.0 * rng.normal(size=robot.num_joints) * np.ones((ticks, 1))
    shape = (ticks, 1)
    log = Log(
        time=time[:, 0],
        qpos=qpos[:, None],
        qvel=qvel[:, None],
        target=qpos[:, None, 7:],
        feedforward=0.25 * torque[:, None],
        feedback=0.75 * torque[:, None],
        contact_force=np.zeros((*shape, robot.num_points, 3)),
        push=np.zeros((*shape, 3)),
        planted=np.ones((*shape, 2), bool),
        limit=robot.torque_limit,
        fell=np.full(1, np.nan),
        watched={},
    )
    smooth = Filter(half=20, order=3, every=10)
    planted = np.array([False, True])
    samples = measured(robot, log, 0, planted, 0.0, rng, smooth=smooth)
    kept = np.arange(20, ticks - 20, 10)
    np.testing.assert_allclose(samples.qpos, qpos[kept], atol=1e-9)
    np.testing.assert_allclose(samples.qacc[:, 6:], 1.0, atol=1e-7)
    felt = torque[kept] - robot.joint_damping * qvel[kept, 6:]
    np.testing.assert_allclose(samples.torque, felt, atol=1e-7)
    np.testing.assert_array_equal(samples.active[0], [False] * 4 + [True] * 4)
    noisy = measured(robot, log, 0, planted, 1.0, rng, smooth=smooth)
    assert 0.0 < np.abs(noisy.torque - samples.torque).max() < 2.0


def test_torques_of_parameters_are_those_of_the_model(robot):
    regressor = InertialRegressor(robot)
    for motion in held_out(robot).values():
        expected = feedforward(robot, motion)
        actual = feedforward_of(regressor, regressor.parameters(), motion)
        error = np.sqrt(np.mean((actual - expected) ** 2))
        assert error < 1e-3 * np.sqrt(np.mean(expected**2))


@pytest.mark.slow
def test_the_torque_error_falls_tenfold():
    """On motions not used for fitting, with and without sensor noise; nothing impossible."""
    result = identification.run(Setting(quick=True))
    for level in (0.0, 1.0):
        assert identification.gains(result.numbers, level).min() >= 10.0
    assert all(row["consistent"] for row in result.numbers["rows"])
    assert identification.EXPERIMENT.show(result)
    verdicts = {finding.verdict for finding in result.findings}
    assert "missed" not in verdicts
