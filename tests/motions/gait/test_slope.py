"""The plane on which the feet stand."""

import numpy as np
import pytest

from fbid_gym.motions.gait.slope import Plane, Sense, feel_ground, height_on, level_moments

TICK = 0.01
SENSE = Sense(0.5, 1e-4)


def felt(places: np.ndarray, sense: Sense = SENSE) -> Plane:
    """The plane after each row of (T, F, 3) was stood on for a while, over and over."""
    moments = level_moments(places[:1])[0]
    for _ in range(40):
        for touched in places:
            for _ in range(10):
                plane = feel_ground(sense, TICK, touched, moments)
    return plane


def on_plane(flat: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Places above (..., 2) on a plane."""
    return np.concatenate([flat, flat @ slope[:, None] + 0.3], axis=-1)


@pytest.mark.parametrize("feet", [2, 4])
def test_on_a_plane_it_is_that_plane(feet, rng):
    """Two feet tell of it, too, once they have stood in several places."""
    slope = np.array([0.2, -0.35])
    places = on_plane(rng.uniform(-0.3, 0.3, (3, feet, 2)), slope)
    exact = felt(places, Sense(0.5, 1e-12))
    assert [exact.slope_x, exact.slope_y] == pytest.approx(slope, abs=1e-6)
    assert height_on(exact, 1.0, 2.0) == pytest.approx(0.3 + slope @ [1.0, 2.0], abs=1e-5)
    drawn = felt(places)
    assert 0.9 * np.linalg.norm(slope) < np.hypot(*drawn[3:]) < np.linalg.norm(slope)


def test_level_ground_is_level_wherever_the_feet_stand(rng):
    flat = rng.uniform(-0.3, 0.3, (5, 4, 2))
    plane = felt(np.concatenate([flat, np.full((5, 4, 1), 0.7)], axis=-1))
    assert np.hypot(*plane[3:]) < 1e-12
    assert height_on(plane, 5.0, -5.0) == pytest.approx(0.7, abs=1e-11)


def test_across_a_line_of_feet_it_is_level():
    line = np.array([[-0.2, -0.1], [0.2, 0.1]])
    places = np.column_stack([line, [-0.05, 0.05]])[None]
    plane = felt(places)
    assert plane.slope_x * -0.1 + plane.slope_y * 0.2 == pytest.approx(0.0, abs=1e-9)
    assert height_on(plane, 0.2, 0.1) == pytest.approx(0.05, rel=0.01)


def test_feet_that_stand_in_one_place_make_no_slope():
    plane = felt(np.array([[[0.1, 0.2, 0.0], [0.1, 0.2, 0.05]]]))
    assert plane == pytest.approx((0.1, 0.2, 0.025, 0.0, 0.0), abs=1e-12)


def test_a_slope_is_felt_slowly(rng):
    """After the time of the sense two thirds of it are there, and a tick does little."""
    flat = rng.uniform(-0.3, 0.3, (4, 2))
    slope = np.array([0.2, 0.1])
    moments = level_moments(on_plane(flat, 0.0 * slope)[None])[0]
    touched = on_plane(flat, slope)
    first = feel_ground(SENSE, TICK, touched, moments)
    assert np.hypot(*first[3:]) < 1.1 * TICK / SENSE.time * np.hypot(*slope)
    for _ in range(round(SENSE.time / TICK) - 1):
        later = feel_ground(SENSE, TICK, touched, moments)
    share = np.hypot(*later[3:]) / np.hypot(*slope)
    assert share == pytest.approx(1.0 - np.exp(-1.0), abs=0.03)
