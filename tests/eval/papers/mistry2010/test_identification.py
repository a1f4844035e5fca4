"""The data of the identification experiment, and what it promises."""

from functools import partial

import numpy as np
import pytest

from eval.papers.experiment import Setting, show
from eval.papers.inertial_parameters.regressor import InertialRegressor
from eval.papers.log import Log
from eval.papers.mistry2010.exciting import STANCES, exciting, measured, smoothed
from eval.papers.mistry2010.identification import (
    feedforward,
    feedforward_of,
    held_out,
    identification,
    improvements,
)
from eval.papers.trial import RATES
from fbid_gym.dynamics import MuJoCoDynamics


def test_filter_is_exact_for_polynomials():
    time = np.arange(400) / RATES.control
    values = np.stack([1.0 + time**3, 2.0 * time**2 - time], axis=1)
    rates = np.stack([3.0 * time**2, 4.0 * time - 1.0], axis=1)
    smooth = partial(smoothed, half=20, order=3, every=7)
    kept = np.arange(20, 380, 7)
    np.testing.assert_allclose(smooth(values), values[kept], atol=1e-9)
    np.testing.assert_allclose(smooth(rates), rates[kept], atol=1e-9)
    np.testing.assert_allclose(smooth(values, 1), rates[kept], atol=1e-8)


@pytest.mark.slow
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
    signals = {"qpos": qpos[:, None], "qvel": qvel[:, None], "torque": torque[:, None]}
    log = Log(time[:, 0], np.full(1, np.nan), signals)
    smooth = partial(smoothed, half=20, order=3, every=10)
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
    for _, motion in held_out(robot).values():
        expected = feedforward(robot, motion)
        actual = feedforward_of(regressor, regressor.parameters(), motion)
        error = np.sqrt(np.mean((actual - expected) ** 2))
        assert error < 1e-3 * np.sqrt(np.mean(expected**2))


@pytest.mark.slow
def test_the_torque_error_falls_tenfold():
    """On motions not used for fitting, with and without sensor noise; nothing impossible."""
    numbers, shown = identification.run(Setting(quick=True))
    for level in (0.0, 1.0):
        assert improvements(numbers, level).min() >= 10.0
    assert all(row["consistent"] for row in numbers["rows"])
    findings, _ = show(identification.name, numbers | shown)
    assert "missed" not in {finding.verdict for finding in findings}
