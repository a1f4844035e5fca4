"""The torque that noise adds is in proportion to it, and another through another layer."""

import pytest

from eval import noise


def test_torque_is_in_proportion_to_the_noise(monkeypatch):
    monkeypatch.setattr(noise, "WARM_UP", (2,))
    env = "fbid_gym/QuadrupedBalance-v0"
    once, twice = (noise.noise_torque(env, "torque", std, 64, 3) for std in (0.02, 0.04))
    assert once > 0.0 and twice == pytest.approx(2.0 * once, rel=0.05)
    assert noise.noise_torque(env, "torque", 0.0, 2, 3) == 0.0
