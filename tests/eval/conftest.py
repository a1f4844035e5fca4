"""A stand-in environment with known outcomes, and run folders that hold policies for it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.policy import Policy
from train.runs.config import TrainConfig
from train.runs.opening import open_run
from train.runs.tables import EVALUATIONS, TableWriter

ENV_ID = "eval_tests/StandIn-v0"
LAYERS = {"base_acceleration": 1.0, "joint_position": 0.4}


class StandIn(gym.Env[np.ndarray, np.ndarray]):
    """Pushes at drawn times; the robot falls at the end of one that its action is too weak for.

    The first entry of the action, times the gain of the layer, is strength: it sets the reward and
    the hardest push survived. Everything random is drawn at reset.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10, "terminations": ("", "fall")}

    def __init__(
        self,
        action_layer: str = "base_acceleration",
        layer_options: dict[str, Any] | None = None,
        push_force: tuple[float, float] = (20.0, 100.0),
        episode_seconds: float = 4.0,
        render_mode: str | None = None,
    ) -> None:
        self.observation_space = gym.spaces.Box(-np.inf, np.inf, (3,))
        self.action_space = gym.spaces.Box(-1.0, 1.0, (2,))
        self.gain, self.push_force, self.render_mode = LAYERS[action_layer], push_force, render_mode
        self.steps = round(10 * episode_seconds)
        del layer_options

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        self.step_count = 0
        self.starts = self.np_random.integers(1, self.steps - 4, size=2)
        self.sizes = self.np_random.uniform(*self.push_force, size=2)
        self.offset = float(self.np_random.uniform(-0.05, 0.05))
        return np.zeros(3, dtype=np.float32), {}

    def push(self) -> float:
        active = (self.starts <= self.step_count) & (self.step_count < self.starts + 3)
        return float(self.sizes[active].max(initial=0.0))

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        strength = self.gain * float(action[0])
        push = self.push()
        fell = bool((self.starts + 2 == self.step_count).any() and push > 60 + 60 * strength)
        self.step_count += 1
        error = self.offset * (1.5 - strength)
        info = {
            "push": np.array([0.6 * push, -0.8 * push, 0.0]),
            "height_error": error,
            "torque_rms": 10.0 + self.step_count,
            "power": 20.0 + push,
            "slip": 0.001 * self.step_count,
            "distance": 0.1 * self.step_count,
            "termination": int(fell),
        }
        observation = np.array([push, self.step_count, error], dtype=np.float32)
        reward = 1.0 - 0.5 * (1.0 - strength) ** 2
        return observation, reward, fell, self.step_count == self.steps and not fell, info

    def render(self) -> np.ndarray:
        picture = np.full((48, 64, 3), 230, dtype=np.uint8)
        picture[:, : int(64 * self.step_count / self.steps)] = (90, 120, 200)
        return picture


gym.register(ENV_ID, entry_point=StandIn)


def constant_policy(env_id: str, seen: int, action: Any, **others: Any) -> Policy:
    """A policy that always does the same, on so many entries of an observation."""
    bias = np.array(action)
    weights = (np.zeros((len(bias), seen)),)
    given = {"mean": np.zeros(seen), "variance": np.ones(seen), "weights": weights} | others
    return Policy(env_id=env_id, biases=(bias,), **{"trained_steps": 1_000_000} | given)


def make_policy(
    strength: float, layer: str = "base_acceleration", algorithm: str = "ppo", **env_args: Any
) -> Policy:
    """A policy that always acts with the same strength."""
    env_args = {"action_layer": layer} | env_args
    return constant_policy(ENV_ID, 3, [strength, 0.0], env_args=env_args, algorithm=algorithm)


def zero_policy(env_id: str, sizes: tuple[int, int], **env_args: Any) -> Policy:
    """A policy of zeros that acts on joint positions; sizes are of what it sees and does."""
    env_args = {"action_layer": "joint_position"} | env_args
    return constant_policy(env_id, sizes[0], np.zeros(sizes[1]), env_args=env_args)


def typical_return(strength: float, layer: str) -> float:
    """Mean return over many episodes."""
    env, returns = StandIn(layer), []
    for seed in range(64):
        env.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            _, reward, terminated, truncated, _ = env.step(np.array([strength, 0.0]))
            total, over = total + reward, terminated or truncated
        returns.append(total)
    return float(np.mean(returns))


def write_run(folder: Path, layer: str, seed: int, **changes: Any) -> Path:
    """Write a run folder with the code that training writes it with, learning curve made up.

    `changes` go into the configuration.
    """
    rng = np.random.default_rng([seed, len(layer)])
    config = TrainConfig(env=ENV_ID, action_layer=layer, seed=seed, out=folder, **changes)
    steps = np.linspace(0, config.total_steps, 21)
    skill = (0.9 if layer == "base_acceleration" else 0.8) + rng.normal(0, 0.05)
    level = typical_return(skill, layer)
    speed = (6.0 if layer == "base_acceleration" else 3.0) * rng.uniform(0.8, 1.25)
    returns = level * (1 - 0.7 * np.exp(-speed * steps / 1e6)) + rng.normal(0, 0.6, 21)
    returns[-1] = level
    wall = steps / (5000 if layer == "base_acceleration" else 9000)
    with open_run(config) as run:
        run.begin()
        table = TableWriter(run.folder.evaluations, EVALUATIONS, None)
        for row in zip(steps, wall, returns, strict=True):
            known = dict(zip(("steps", "wall_seconds", "return_mean"), row, strict=True))
            table.append(dict.fromkeys(EVALUATIONS, 0.0) | known | {"episodes": 32})
        table.close()
        policy = make_policy(skill, algorithm=config.algorithm, **config.make_args())
        policy.save(run.folder.policy)
        best = replace(policy, trained_steps=int(steps[returns.argmax()]))
        best.save(run.folder.best_policy)
    return folder


@pytest.fixture
def run_folder(tmp_path):
    """Write a run folder: layer, seed and what differs in its configuration."""

    def build(layer: str = "base_acceleration", seed: int = 0, **changes: Any) -> Path:
        name = changes.pop("name", f"{layer}-s{seed}")
        return write_run(tmp_path / name, layer, seed, **changes)

    return build
