"""Which episodes count, and what is counted in them, against a plain loop over one environment."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from fbid_gym.errors import InvalidValueError
from tests.eval.conftest import StandIn
from train.episodes import play, shares

MODES = [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP]


def vector(count: int, mode: AutoresetMode) -> SyncVectorEnv:
    return SyncVectorEnv([StandIn] * count, autoreset_mode=mode)


def act(observation: np.ndarray) -> np.ndarray:
    return np.full((len(observation), 2), 0.3, dtype=np.float32)


def by_hand(env: gym.Env[Any, Any], seed: int, episodes: int) -> list[dict[str, float]]:
    """Play the environment on its own and reckon everything from the definitions."""
    results = []
    observation, _ = env.reset(seed=seed)
    for episode in range(episodes):
        rewards, infos, terminated, truncated = [], [], False, False
        while not (terminated or truncated):
            observation, reward, terminated, truncated, info = env.step(act(observation[None])[0])
            rewards.append(reward)
            infos.append(info)
        force = np.array([np.hypot(*info["push"][:2]) for info in infos])
        began = int(np.sum((force > 0) & (np.concatenate([[0.0], force[:-1]]) == 0)))
        power = np.array([info["power"] for info in infos])
        results.append(
            {
                "returned": sum(rewards),
                "length": len(rewards),
                "seconds": len(rewards) * 0.1,
                "survived": float(truncated),
                "height_error": np.sqrt(np.mean([info["height_error"] ** 2 for info in infos])),
                "torque": np.sqrt(np.mean([info["torque_rms"] ** 2 for info in infos])),
                "power": power.mean(),
                "energy": power.sum() * 0.1,
                "slip": np.mean([info["slip"] for info in infos]),
                "distance": infos[-1]["distance"],
                "pushes": began,
                "pushes_survived": began - int(terminated),
                "strongest_push": force.max(),
            }
        )
        if episode + 1 < episodes:
            observation, _ = env.reset()
    return results


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("count", "episodes"), [(1, 3), (4, 4), (3, 8), (5, 2)])
def test_every_column_is_that_of_the_environment_alone(mode, count, episodes):
    played = play(vector(count, mode), act, episodes, seed=40, step_seconds=0.1)
    expected = [
        result
        for i, share in enumerate(shares(episodes, count))
        for result in by_hand(StandIn(), 40 + i, share)
    ]
    assert len(played) == len(expected) == episodes
    for name in expected[0]:
        actual = getattr(played, name)
        np.testing.assert_allclose(actual, [e[name] for e in expected], rtol=1e-12, err_msg=name)
    fell = [reason == "fall" for reason in played.termination]
    np.testing.assert_array_equal(fell, played.survived == 0)
    assert 0 < sum(fell) or episodes < 8  # the fixture does make robots fall


def test_shares_are_even_and_complete():
    for episodes in range(1, 20):
        for count in range(1, 12):
            share = shares(episodes, count)
            assert share.sum() == episodes and share.max() - share.min() <= 1


def test_what_the_environment_does_not_report_is_nan():
    class Silent(gym.Wrapper):  # type: ignore[type-arg]
        def step(self, action: Any) -> Any:
            observation, reward, terminated, truncated, _ = self.env.step(action)
            return observation, reward, terminated, truncated, {}

    envs = SyncVectorEnv([lambda: Silent(StandIn())])
    played = play(envs, act, 2, seed=0, step_seconds=0.1)
    assert np.isnan(played.slip).all() and np.isnan(played.torque).all()
    assert played.pushes.tolist() == [0, 0] and played.termination == ("", "")
    assert np.isfinite(played.returned).all()


def test_refuses_what_it_cannot_count():
    envs = vector(2, AutoresetMode.NEXT_STEP)
    with pytest.raises(InvalidValueError, match="Invalid episodes: 0. Expected a positive number"):
        play(envs, act, 0, seed=0, step_seconds=0.1)
    envs = vector(2, AutoresetMode.DISABLED)
    with pytest.raises(InvalidValueError, match="Expected NEXT_STEP or SAME_STEP"):
        play(envs, act, 2, seed=0, step_seconds=0.1)
