"""What a walk without a policy is summarised to."""

import numpy as np
import pytest

from eval.walking import Trial, WalkingConfig, summarised, walk
from fbid_gym.robots import load


def told(up: np.ndarray) -> dict[str, np.ndarray]:
    steps, robots = up.shape
    return {
        "up": up,
        "miss": np.ones((steps, robots, 2)) * [0.3, 0.4],
        "turn": np.full((steps, robots), -0.2),
        "power": np.full((steps, robots), 6.0),
        "way": np.full((steps, robots), 0.5),
    }


def test_moments_count_until_a_robot_falls():
    up = np.ones((4, 2), bool)
    up[2:, 0] = False
    numbers = told(up)
    for name in ("miss", "turn", "power", "way"):
        numbers[name][~up] = 1e9
    walked = summarised(numbers, hz=2, weight=3.0)
    assert walked.survival == 0.5
    assert walked.velocity_error == pytest.approx(0.5)
    assert walked.turning_error == pytest.approx(0.2)
    assert walked.transport == pytest.approx(4.0)


def test_where_all_fall_none_is_up():
    up = np.ones((3, 2), bool)
    up[1, 0], up[2] = False, False
    assert summarised(told(up), hz=2, weight=1.0).survival == 0.0
    at_once = summarised(told(np.zeros((1, 2), bool)), hz=2, weight=1.0)
    assert at_once.survival == 0.0 and np.isnan(at_once.velocity_error)
    assert np.isnan(at_once.transport)


def test_a_biped_without_a_gait_falls_every_time():
    config = WalkingConfig(episodes=2, seconds=10.0)
    assert walk(Trial(load("biped"), None, "torque"), config).survival == 0.0
