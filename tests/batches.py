"""Batches of environments that have begun."""

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np

from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.envs.policy_step import Step
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.runtime.effort import Effort
from fbid_gym.tasks.outcome import Outcome

# Episodes end by falling and by the clock, and pushes come soon.
SHORT = {"episode_seconds": 0.3, "push_duration": 0.05}
SHORT |= {"push_interval": (0.1, 0.2), "push_velocity": (0.0, 0.2)}
RANDOM = {"mass": 0.2, "com": 0.01, "friction": (0.5, 1.0), "motor_strength": (0.8, 1.2)}
RANDOM |= {"action_delay": (0.0, 0.05), "model_mass": 0.1, "model_com": 0.005}


def started(arguments: Mapping[str, Any], count: int) -> EnvBatch:
    """So many robots at the start of an episode, each with its number for a seed."""
    batch = EnvBatch(EnvConfig.of(dict(arguments)), count)
    for env in range(count):
        batch.seed(env, np.random.default_rng(env))
    batch.reset(np.arange(count))
    return batch


def upright(batch: EnvBatch, seconds: float) -> list[Step]:
    """Step by a zero action, and see that nobody falls."""
    zero, steps = np.zeros((batch.num_envs, len(batch.action_names))), []
    for _ in range(round(seconds * batch.rates.policy)):
        steps.append(batch.step(zero))
        assert not steps[-1].terminated.any()
    return steps


class Watched:
    """A layer, and what it was told, said and kept from tick to tick."""

    def __init__(self, layer: Any) -> None:
        self._layer, self.planted, self.torques, self.memories = layer, [], [], []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._layer, name)

    def torque(self, action: Any, state: Any, target: Any, terms: Any, memory: Any) -> np.ndarray:
        said = self._layer.torque(action, state, target, terms, memory)
        self.planted.append(target.planted.copy())
        self.torques.append(said.copy())
        self.memories.append({name: value.copy() for name, value in memory.items()})
        return said


def outcome_of(batch: EnvBatch) -> Outcome:
    """What a task would measure now, of robots that have not moved since the last step."""
    return batch._outcome(Effort.none(batch.num_envs, batch.robot.num_joints))


def begun(env_id: str, count: int | None = None, seed: int = 0, **arguments: Any) -> Any:
    """An environment of Gymnasium's at the start of an episode; of so many robots if told."""
    if count is not None:
        arguments["num_envs"] = count
    env = (gym.make if count is None else gym.make_vec)(env_id, **arguments)
    env.reset(seed=seed)
    return env


def assert_same(one: Mapping[str, Any], other: Mapping[str, Any]) -> None:
    """The same arrays to the bit, as in a state before and after."""
    assert one.keys() == other.keys()
    for name, value in one.items():
        np.testing.assert_array_equal(value, other[name], err_msg=name)
