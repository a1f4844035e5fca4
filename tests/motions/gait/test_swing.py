"""Swing curves: they meet their ends, clear the ground, and are smooth."""

import numpy as np
import pytest

from fbid_gym.motions.gait.swing import Moving, across, below, over

SPAN = 0.23  # s
LIFT = 0.08  # m


def curve(function, *arguments: float, count: int = 2001) -> Moving:
    """The motion at evenly spaced shares of its span, as arrays."""
    shares = np.linspace(0.0, 1.0, count)
    return Moving(*np.array([function(share, SPAN, *arguments) for share in shares]).T)


@pytest.mark.parametrize(
    ("function", "ends"),
    [(across, (0.3, -0.2)), (over, (0.0, 0.15, LIFT)), (over, (0.1, -0.05, LIFT))],
)
def test_ends_are_met_at_rest_and_rates_are_derivatives(function, ends):
    first, last = function(0.0, SPAN, *ends), function(1.0, SPAN, *ends)
    np.testing.assert_allclose(first, (ends[0], 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(last, (ends[1], 0.0, 0.0), atol=1e-9)
    motion = curve(function, *ends)
    step = SPAN / (len(motion.value) - 1)
    for whole, rate in ((motion.value, motion.rate), (motion.rate, motion.acceleration)):
        slope = (whole[2:] - whole[:-2]) / (2.0 * step)
        assert np.abs(slope - rate[1:-1]).max() < 5e-3 * np.abs(rate).max()
    # A jump would not shrink with the step; the greatest jerk of these quintics is 60 way / half^3.
    jerk = 60.0 * (np.ptp(ends) + LIFT) / (0.5 * SPAN) ** 3
    assert np.abs(np.diff(motion.acceleration)).max() < jerk * step


def test_a_foot_rises_above_both_ends_and_never_sinks_below_them():
    for start, end in ((0.0, 0.0), (0.0, 0.15), (0.15, 0.0)):
        height = curve(over, start, end, LIFT).value
        assert height.max() == pytest.approx(max(start, end) + LIFT, abs=1e-12)
        assert height.min() >= min(start, end) - 1e-12
        # Up, then down: over a step it is above its edge before it is half-way.
        assert (np.diff(height[:1001]) >= -1e-12).all() and (np.diff(height[1000:]) <= 1e-12).all()


def test_a_foot_that_finds_no_ground_reaches_down_from_rest_and_then_evenly():
    ramp, speed, step = 0.1, 0.5, 1e-4
    clock = np.arange(0.0, 0.3, step)
    motion = Moving(*np.array([below(t, ramp, speed) for t in clock]).T)
    assert motion.value[0] == motion.rate[0] == motion.acceleration[0] == 0.0
    for whole, rate in ((motion.value, motion.rate), (motion.rate, motion.acceleration)):
        slope = (whole[2:] - whole[:-2]) / (2.0 * step)
        assert np.abs(slope - rate[1:-1]).max() < 5e-3 * np.abs(rate).max()
    assert (np.diff(motion.value) > 0.0).all()
    assert motion.rate[clock > ramp] == pytest.approx(speed)
