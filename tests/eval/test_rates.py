"""What the rates change of walking: what is compared, and how."""

import pytest

from eval.rates import EXACT, SETTINGS, RatesConfig, apart, settings
from eval.walking import Trial, Walked, WalkingConfig, walk
from fbid_gym import robots
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.config import EnvConfig


def walked(survival: float, error: float) -> Walked:
    return Walked(survival, error, 0.0, 0.0, 0.0, 0.0)


def test_differences_are_shares_of_the_exact_walk() -> None:
    assert apart(walked(0.9, 0.11), walked(1.0, 0.1)) == pytest.approx((-0.1, 0.1))
    assert apart(walked(1.0, 0.1), walked(1.0, 0.1)) == (0.0, 0.0)
    assert apart(walked(0.0, 0.2), walked(0.0, 0.1)) == pytest.approx((0.0, 1.0))
    assert apart(walked(0.5, 0.1), walked(0.0, 0.1))[0] == float("inf")


def test_the_papers_rates_are_compared_with_the_environments_own() -> None:
    short, long = settings(RatesConfig()), settings(RatesConfig(steps=True))
    assert list(long.values())[0] == list(short.values())[0] == EXACT
    assert list(short.values())[-1] == {}
    for env in ("fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedWalk-v0"):
        config = EnvConfig.of(ENVIRONMENTS[env] | EXACT)
        ours = EnvConfig.of(ENVIRONMENTS[env])
        assert config.rates().physics == 1000 and config.rates().control == 500
        assert ours.rates().physics == ours.rates().control == 250
        # Each setting on the way is cheaper by one thing.
        told = [EnvConfig.of(ENVIRONMENTS[env] | each) for each in SETTINGS.values()]
        names = ("physics_hz", "control_hz", "friction_cone", "solver_iterations")
        apart = [
            sum(getattr(one, name) != getattr(other, name) for name in names)
            for one, other in zip(told, told[1:], strict=False)
        ]
        assert apart == [1, 1, 1, 1] and told[0] == config and told[-1] == ours


@pytest.mark.slow
@pytest.mark.parametrize("layer", ["base_acceleration", "joint_position"])
def test_walking_hardly_depends_on_the_rates(layer: str) -> None:
    trial, walking = Trial(robots.load("go1"), "trot", layer), WalkingConfig(episodes=16, seconds=5)
    cheap, exact = walk(trial, walking), walk(trial, walking, **EXACT)
    # A tenth over the robots and seconds of docs/rates.md; these are fewer.
    assert cheap.survival == exact.survival == 1.0
    assert abs(apart(cheap, exact)[1]) < 0.15
