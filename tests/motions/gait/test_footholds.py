"""Footholds of the linear inverted pendulum: it goes where it is told, whatever it did before."""

import math

import pytest

from fbid_gym.motions.gait.footholds import Leap, point_ahead, within_reach
from fbid_gym.motions.gait.heading import turned

OMEGA, STANCE = 5.8, 0.27


def passed_over(offset: float, velocity: float) -> tuple[float, float]:
    """Place from the foot, and velocity, of a pendulum after the foot has stood its time."""
    grown, turn = math.cosh(OMEGA * STANCE), math.sinh(OMEGA * STANCE)
    return grown * offset + turn * velocity / OMEGA, OMEGA * turn * offset + grown * velocity


@pytest.mark.parametrize("commanded", [0.0, 0.6, -1.1])
def test_one_step_brings_the_capture_point_to_where_the_commanded_gait_has_it(commanded, rng):
    leap = Leap(OMEGA, STANCE, 1.0)
    for velocity in rng.uniform(-2.0, 2.0, 20):
        ahead = point_ahead(leap, velocity, commanded)
        offset, after = passed_over(-ahead, velocity)
        # From the foot, at the next landing: a stride v T, of which the gait repeats.
        stride = commanded * STANCE
        periodic = stride + stride / math.expm1(OMEGA * STANCE)
        assert offset + after / OMEGA == pytest.approx(periodic, abs=1e-9)


@pytest.mark.parametrize("capture", [1.0, 0.85, 1.2])
@pytest.mark.parametrize("commanded", [0.0, 0.6, -1.1])
def test_steps_lead_to_the_commanded_velocity(commanded, capture):
    leap, velocity, travelled = Leap(OMEGA, STANCE, capture), 1.7, []
    for _ in range(60):
        ahead = point_ahead(leap, velocity, commanded)
        offset, velocity = passed_over(-ahead, velocity)
        travelled.append(offset + ahead)
    assert travelled[-1] / STANCE == pytest.approx(commanded, abs=1e-9)
    # Then it lands half a stride ahead: Raibert's neutral point.
    assert point_ahead(leap, velocity, commanded) == pytest.approx(0.5 * travelled[-1], abs=1e-9)


def test_a_foothold_within_reach_stays_and_another_is_the_nearest_that_is():
    hip = (0.3, -0.2)
    assert within_reach(hip, 0.1, 0.35, -0.2) == (0.35, -0.2, False)
    x, y, clipped = within_reach(hip, 0.1, 0.6, 0.2)
    assert clipped and (x, y) == pytest.approx((0.3 + 0.06, -0.2 + 0.08))
    assert within_reach(hip, 0.0, 0.6, 0.2) == (*hip, True)


def test_turning_keeps_lengths_and_adds_angles():
    x, y = turned(0.4, *turned(0.3, 0.2, -0.5))
    assert (x, y) == pytest.approx(turned(0.7, 0.2, -0.5))
    assert turned(math.pi / 2.0, 1.0, 0.0) == pytest.approx((0.0, 1.0))
