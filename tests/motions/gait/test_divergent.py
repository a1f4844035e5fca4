"""Steps of the pendulum against its differential equation, integrated."""

import math

import numpy as np
import pytest

from fbid_gym.motions.gait.divergent import (
    StepTiming,
    error_to_come,
    fall,
    offset_ahead,
    offset_inward,
    stride_to_catch,
    transfer,
)
from fbid_gym.motions.gait.hull import nearest_in_hull
from fbid_gym.motions.gait.swing import lift_and_land

TIMINGS = [StepTiming(3.8, 0.13, 0.4), StepTiming(3.2, 0.3, 0.35), StepTiming(5.0, 0.02, 0.6)]


def integrated(omega: float, xi: float, behind: float, ahead: float, span: float) -> float:
    """Integrate xid = omega (xi - p) over a span, p evenly from `behind` to `ahead`."""
    count = 20000
    for i in range(count):
        pressure = behind + (ahead - behind) * (i + 0.5) / count
        xi = pressure + (xi - pressure) * math.exp(omega * span / count)
    return xi


@pytest.mark.parametrize("span", [0.0, 1e-9, 0.05, 0.4])
def test_fall_obeys_the_pendulum(span):
    found = fall(3.5, 0.11, -0.04, 0.07, span)
    assert found == pytest.approx(integrated(3.5, 0.11, -0.04, 0.07, span), abs=1e-8)


@pytest.mark.parametrize("timing", TIMINGS)
@pytest.mark.parametrize("roll", [0.0, 0.08, -0.05])
def test_offset_ahead_repeats_with_every_step(timing, roll):
    stride, offset = 0.3, offset_ahead(timing, 0.3, roll)
    landed = integrated(timing.omega, offset, -roll, roll, timing.single)
    behind, ahead = roll, stride - roll
    again = integrated(timing.omega, landed, behind, ahead, timing.double) - stride
    assert again == pytest.approx(offset, abs=1e-8)


@pytest.mark.parametrize("timing", TIMINGS)
def test_centre_of_mass_goes_evenly_where_pressure_rolls_with_it(timing):
    velocity = 0.4
    stride, roll = velocity * (timing.double + timing.single), 0.5 * velocity * timing.single
    # Of an even motion xi is v / omega ahead of the centre of mass, which is above the pressure.
    even = velocity / timing.omega - roll
    assert offset_ahead(timing, stride, roll) == pytest.approx(even, abs=1e-12)


@pytest.mark.parametrize("timing", TIMINGS)
def test_offset_inward_repeats_on_the_other_foot(timing):
    width, offset = 0.2, offset_inward(timing, 0.2)
    landed = offset * math.exp(timing.omega * timing.single)
    again = width - integrated(timing.omega, landed, 0.0, width, timing.double)
    assert again == pytest.approx(offset, abs=1e-8)


@pytest.mark.parametrize("timing", TIMINGS)
@pytest.mark.parametrize(("landing", "roll"), [(-0.2, 0.0), (0.0, 0.08), (0.35, -0.05)])
def test_caught_pendulum_is_where_it_shall_be(timing, landing, roll):
    offset = 0.03
    stride = stride_to_catch(timing, landing, offset, roll)
    found = integrated(timing.omega, landing, roll, stride - roll, timing.double) - stride
    assert found == pytest.approx(offset, abs=1e-8)


@pytest.mark.parametrize("error", [-0.2, -0.04, 0.0, 0.02, 0.09])
def test_error_to_come_where_pressure_yields_or_not(error):
    omega, gain, reach, left = 3.5, 2.0, 0.06, 0.4
    now, step = error, 1e-5
    for _ in range(round(left / step)):
        pressure = min(max((1.0 + gain) * now, -reach), reach)
        now += step * omega * (now - pressure)
    found = error_to_come(omega, gain, error, reach, left)
    held, beyond = (1.0 + gain) * abs(error) <= reach, abs(error) > reach
    if held or beyond:
        assert found == pytest.approx(now, abs=1e-4)
    else:  # saturated at first, then not
        assert abs(now) <= reach
        assert abs(found) <= reach
    assert found == -error_to_come(omega, gain, -error, reach, left)


def test_transfer_begins_and_ends_as_given_and_obeys_the_pendulum():
    omega, span = 3.5, 0.3
    ends = (0.05, 0.12, 0.21, 0.18)
    assert transfer(omega, *ends, span, 0.0) == pytest.approx(ends[:2], abs=1e-12)
    assert transfer(omega, *ends, span, span) == pytest.approx(ends[2:], abs=1e-12)
    assert transfer(omega, *ends, span, math.inf) == pytest.approx(ends[2:], abs=1e-12)
    for clock in np.linspace(0.01, 0.29, 7):
        before, after = (transfer(omega, *ends, span, clock + d)[0] for d in (-1e-5, 1e-5))
        xi, pressure = transfer(omega, *ends, span, clock)
        assert (after - before) / 2e-5 == pytest.approx(omega * (xi - pressure), abs=1e-7)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 8])
def test_nearest_point_of_a_hull(count):
    rng = np.random.default_rng(count)
    for _ in range(50):
        points, place = rng.normal(size=(count, 2)), 2.0 * rng.normal(size=2)
        found = np.array(nearest_in_hull(points, tuple(place)))
        # The projection on a convex set: no point of it lies beyond, as seen from the place.
        assert ((points - found) @ (place - found)).max() < 1e-9
        inside = rng.dirichlet(np.ones(count)) @ points
        np.testing.assert_allclose(nearest_in_hull(points, tuple(inside)), inside, atol=1e-9)
        # It is in the hull itself: the same point is found again.
        np.testing.assert_allclose(nearest_in_hull(points, tuple(found)), found, atol=1e-9)


def test_swing_meets_its_ends():
    span, start, apex, ground, sink = 0.45, 0.02, 0.1, -0.03, 0.09
    curve = (span, start, apex, ground, sink)
    np.testing.assert_allclose(lift_and_land(0.0, *curve), (start, 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(lift_and_land(0.5 * span, *curve), (apex, 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(lift_and_land(span, *curve), (ground, -sink, 0.0), atol=1e-9)
    assert lift_and_land(span + 0.1, *curve)[0] == pytest.approx(ground - 0.1 * sink)
    for edge in (0.5 * span, span):
        before, after = lift_and_land(edge - 1e-12, *curve), lift_and_land(edge + 1e-12, *curve)
        np.testing.assert_allclose(before, after, atol=1e-8)
    for clock in np.linspace(0.01, 0.5, 23):
        motion = lift_and_land(clock, *curve)
        for order in range(2):
            before, after = (lift_and_land(clock + d, *curve)[order] for d in (-1e-6, 1e-6))
            assert (after - before) / 2e-6 == pytest.approx(motion[order + 1], abs=1e-4)
