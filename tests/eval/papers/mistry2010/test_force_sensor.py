"""The sensor's step response, delay and noise, each against its closed form."""

import math

import numpy as np
import pytest

from eval.papers.mistry2010.force_sensor import ForceSensor, Readings


def record(sensor, forces, rng):
    """Measurements (T, N, k) of forces (T, N, k), and what is remembered."""
    state: Readings | None = None
    measured = []
    for force in forces:
        reading, state = sensor.measure(force, state, rng)
        measured.append(reading)
    assert state is not None
    return np.array(measured), state


def test_an_ideal_sensor_reports_the_force(rng):
    forces = rng.normal(size=(20, 3, 6))
    measured, _ = record(ForceSensor(500.0), forces, rng)
    np.testing.assert_array_equal(measured, forces)


@pytest.mark.parametrize("delay", [1, 2, 7])
def test_delay_is_exact(rng, delay):
    """And until the first sample is through, it stands for what came before."""
    forces = rng.normal(size=(20, 3, 6))
    measured, _ = record(ForceSensor(500.0, delay=delay), forces, rng)
    np.testing.assert_array_equal(measured[delay:], forces[:-delay])
    np.testing.assert_array_equal(measured[:delay], np.broadcast_to(forces[0], (delay, 3, 6)))


@pytest.mark.parametrize("cutoff", [5.0, 40.0, 400.0])
def test_step_response_is_that_of_the_continuous_filter(rng, cutoff):
    """A force that jumps from 0 to 1 between two ticks: 1 - exp(-2 pi cutoff t) at the ticks."""
    forces = np.zeros((60, 2, 3))
    forces[1:] = 1.0
    measured, _ = record(ForceSensor(500.0, cutoff_hz=cutoff), forces, rng)
    response = 1.0 - np.exp(-2.0 * math.pi * cutoff * np.arange(60) / 500.0)
    expected = np.broadcast_to(response[:, None, None], forces.shape)
    np.testing.assert_allclose(measured, expected, atol=1e-12)


def test_slow_forces_pass_and_fast_ones_do_not(rng):
    """Amplitude 1 / sqrt(1 + (f / cutoff)^2), at a control rate far above."""
    time = np.arange(8000) / 4000.0
    for frequency, cutoff in ((2.0, 20.0), (20.0, 20.0), (100.0, 20.0)):
        forces = np.sin(2.0 * math.pi * frequency * time)[:, None, None]
        measured, _ = record(ForceSensor(4000.0, cutoff_hz=cutoff), forces, rng)
        gain = np.abs(measured[4000:]).max()
        assert gain == pytest.approx(1.0 / math.hypot(1.0, frequency / cutoff), rel=0.02)


@pytest.mark.parametrize("cutoff", [math.inf, 30.0])
def test_noise_has_its_standard_deviation(rng, cutoff):
    sensor = ForceSensor(500.0, noise=3.0, cutoff_hz=cutoff)
    measured, _ = record(sensor, np.full((2000, 5, 10), 100.0), rng)
    settled = measured[200:]
    kept = math.sqrt((1.0 - sensor.kept) / (1.0 + sensor.kept))
    assert settled.std() == pytest.approx(3.0 * kept, rel=0.03)
    assert settled.mean() == pytest.approx(100.0, abs=0.1)
    # Components and robots are independent.
    flat = settled.reshape(len(settled), -1)
    correlation = np.corrcoef(flat.T) - np.eye(50)
    assert np.abs(correlation).max() < 0.3


def test_the_generator_decides_the_noise():
    forces = np.zeros((30, 2, 3))
    sensor = ForceSensor(500.0, noise=1.0, cutoff_hz=30.0, delay=2)
    first, second, third = (
        record(sensor, forces, np.random.default_rng(seed))[0] for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, second)
    assert (first != third).all()


def test_measuring_leaves_the_state_alone(rng):
    sensor = ForceSensor(500.0, noise=1.0, cutoff_hz=10.0, delay=3)
    _, state = record(sensor, rng.normal(size=(5, 2, 3)), rng)
    before = [x.copy() for x in state]
    sensor.measure(rng.normal(size=(2, 3)), state, rng)
    for now, then in zip(state, before, strict=True):
        np.testing.assert_array_equal(now, then)
