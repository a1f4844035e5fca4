"""A small deterministic environment that stands in for the robots, for fast tests.

Point masses on a line are pushed at random and must stay near the origin. `train_and_die` trains on
them, or on robots, in a process that sends itself a signal in a given step.
"""

import csv
import json
import multiprocessing
import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv

from fbid_gym.bundles import Bundle, load_bundle
from fbid_gym.errors import RunError
from tests.batches import assert_same
from train import training
from train.runs.config import CrossQConfig, EvaluationConfig, PPOConfig, SACConfig, TrainConfig
from train.runs.folder import RunFolder

STEPS = 40


class PointMasses(VecEnv):
    """Position, velocity and push of `num_envs` masses; an episode ends beyond |x| > 1."""

    def __init__(self, num_envs: int, seed: int, strength: float = 3.0) -> None:
        self.render_mode = None
        seen = spaces.Box(-np.inf, np.inf, (3,), np.float32)
        super().__init__(num_envs, seen, spaces.Box(-1.0, 1.0, (2,), np.float32))
        self.strength = strength
        self.x = np.zeros((num_envs, 3))
        self.time = np.zeros(num_envs, dtype=np.int64)
        self.total = np.zeros(num_envs)
        self.seed(seed)

    def reset(self) -> np.ndarray:
        if self._seeds[0] is not None:
            self.generators = [np.random.default_rng(s) for s in self._seeds]
            self._reset_seeds()
        for i in range(self.num_envs):
            self._begin(i)
        return self.x.astype(np.float32)

    def _begin(self, i: int) -> None:
        self.x[i] = (*self.generators[i].normal(0.0, 0.1, 2), 0.0)
        self.time[i], self.total[i] = 0, 0.0

    def step_async(self, actions: np.ndarray) -> None:
        self.actions = actions

    def step_wait(self) -> Any:
        for i, generator in enumerate(self.generators):
            if generator.random() < 0.2:
                self.x[i, 2] = generator.normal(0.0, self.strength)
        force = self.actions.astype(np.float64) @ (5.0, -1.0) + self.x[:, 2]
        self.x[:, 1] += 0.05 * force
        self.x[:, 0] += 0.05 * self.x[:, 1]
        self.time += 1
        reward = np.exp(-4.0 * self.x[:, 0] ** 2).astype(np.float32)
        self.total += reward
        fell = np.abs(self.x[:, 0]) > 1.0
        late = (self.time >= STEPS) & ~fell
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(fell | late):
            infos[i] = {
                "terminal_observation": self.x[i].astype(np.float32),
                "TimeLimit.truncated": bool(late[i]),
                "episode": {"r": self.total[i], "l": int(self.time[i]), "t": time.monotonic()},
            }
            self._begin(i)
        return self.x.astype(np.float32), reward, fell | late, infos

    def state_dict(self) -> dict[str, np.ndarray]:
        generators = json.dumps([each.bit_generator.state for each in self.generators]).encode()
        state = {"x": self.x.copy(), "time": self.time.copy(), "total": self.total.copy()}
        return state | {"generators": np.frombuffer(generators, np.uint8).copy()}

    def load_state_dict(self, state: dict[str, np.ndarray]) -> None:
        if state["x"].shape != self.x.shape:
            raise ValueError(f"x is {state['x'].shape}, not {self.x.shape}")
        self.x[:], self.time[:], self.total[:] = state["x"], state["time"], state["total"]
        self.generators = []
        for words in json.loads(bytes(state["generators"])):
            self.generators.append(np.random.default_rng())
            self.generators[-1].bit_generator.state = words

    def close(self) -> None:
        pass

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self, attr_name)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, **kwargs: Any) -> list[Any]:
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * self.num_envs


class PointMassEpisodes(VectorEnv):
    """The same as Gymnasium sees it, for evaluations."""

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP, "render_fps": 20}

    def __init__(
        self, num_envs: int, num_threads: int = 1, strength: float = 3.0, **layer: Any
    ) -> None:
        del num_threads, layer
        self.num_envs, self.masses = num_envs, PointMasses(num_envs, 0, strength)

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[np.ndarray, dict[str, Any]]:
        self.masses.seed(seed)
        return self.masses.reset(), {}

    def step(self, actions: np.ndarray) -> Any:
        observation, reward, done, infos = self.masses.step(actions)
        late = np.array([info.get("TimeLimit.truncated", False) for info in infos])
        return observation, reward, done & ~late, late, {}


ENV_ID = "stand-in/PointMasses-v0"
gym.register(ENV_ID, vector_entry_point=PointMassEpisodes)


def make(env_id: str, *, num_envs: int, seed: int, num_threads: int, **env_args: Any) -> VecEnv:
    """Take what `fbid_gym.make_sb3` takes; these masses do not begin together."""
    return PointMasses(num_envs, seed, env_args.get("strength", 3.0))


OFF_POLICY: dict[str, Any] = {"n_steps": 16, "gradient_steps": 1, "batch_size": 32,
                              "buffer_size": 400, "learning_starts": 200, "policy_starts": 300,
                              "hidden": (16, 16)}  # fmt: skip


def config(out: Path, **changes: Any) -> TrainConfig:
    """Return a run of 6 iterations of 128 steps, evaluated and saved within it."""
    own = {
        "ppo": PPOConfig(n_steps=16, batch_size=64, n_epochs=2, hidden=(16, 16)),
        # Half of the training fits into the buffer.
        "sac": SACConfig(**OFF_POLICY),
        "crossq": CrossQConfig(policy_delay=2, value_hidden=(16, 16), **OFF_POLICY),
    }  # fmt: skip
    algorithm = changes.get("algorithm", "ppo")
    fields: dict[str, Any] = {"env": ENV_ID, "action_layer": "force", "seed": 3, "num_envs": 8}
    fields |= {"total_steps": 768, "num_threads": 1, "checkpoint_every": 256}
    fields |= {"eval": EvaluationConfig(every=300, episodes=4, seed=77), algorithm: own[algorithm]}
    return TrainConfig(out=out, **fields | changes)


def tiny(out: Path, **changes: Any) -> TrainConfig:
    """A training of four robots that takes two iterations."""
    fields = {"env": "fbid_gym/QuadrupedBalance-v0", "action_layer": "joint_position"}
    size = {"total_steps": 64, "num_envs": 4, "ppo": PPOConfig(n_steps=8, batch_size=32)}
    evaluation = {"eval": EvaluationConfig(every=32, episodes=3)}
    return config(out, **fields | size | evaluation | changes)


def draw_network(learner: BaseAlgorithm) -> None:
    """Give a learner a network whose actions differ, some at their limits.

    What little training comes to is another network on another machine, of constant actions or of
    sums so large that float32 rounds them by more than a test allows.
    """
    generator = torch.Generator().manual_seed(5)
    with torch.no_grad():
        for parameter in learner.policy.parameters():
            parameter.normal_(0.0, 0.1 if parameter.ndim > 1 else 1.0, generator=generator)


def make_dying(step: int, signal_number: int, make_env: Any = make) -> Any:
    """Return a maker whose environment sends this process a signal in its n-th step."""

    def make_env_dying(env_id: str, **arguments: Any) -> VecEnv:
        env = make_env(env_id, **arguments)
        step_wait, steps = env.step_wait, 0

        def step_wait_dying() -> Any:
            nonlocal steps
            steps += 1
            if steps == step:
                os.kill(os.getpid(), signal_number)
            return step_wait()

        env.step_wait = step_wait_dying  # type: ignore[method-assign]
        return env

    return make_env_dying


WALL = ("wall_seconds", "fps")
# What a run leaves.
FILES = {"config.json", "versions.json", "progress.csv", "evaluations.csv", "tensorboard"}
FILES |= {f"{name}.safetensors" for name in ("checkpoint", "policy", "policy_best")}


def train(folder: Path, **changes: Any) -> Path:
    """Train on the point masses."""
    return training.main(config(folder, **changes), make)


# A server imports what trains once, and forks a process for each training that shall die.
_SERVER = multiprocessing.get_context("forkserver")
_SERVER.set_forkserver_preload(["train.training"])


def train_and_die(
    folder: Path, step: int, number: int = signal.SIGKILL, *, real: bool = False, **changes: Any
) -> str:
    """Train in a process of its own that gets a signal in the given step; return its output."""
    log = folder.with_name(f"{folder.name}.log")
    own = config(folder, **changes)
    process = _SERVER.Process(target=_train_dying, args=(own, step, int(number), real, log))
    process.start()
    process.join(120.0)
    died = -number if number == signal.SIGKILL else 130
    assert process.exitcode == died, log.read_text()
    return log.read_text()


def _train_dying(own: TrainConfig, step: int, number: int, real: bool, log: Path) -> None:
    output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(output, 1), os.dup2(output, 2)
    try:
        training.main(own, make_dying(step, number, training.make_sb3 if real else make))
    except KeyboardInterrupt:
        sys.exit(130)


def rows(file: Path) -> list[dict[str, str]]:
    """Return what a table holds."""
    return list(csv.DictReader(file.read_text().splitlines()))


def curve(file: Path) -> list[dict[str, str]]:
    """Return what a table holds but the clock."""
    return [{k: v for k, v in row.items() if k not in WALL} for row in rows(file)]


def checkpoint(folder: Path) -> Bundle:
    """Return a run's checkpoint."""
    return load_bundle(RunFolder.of(folder).checkpoint, RunError)


def assert_same_run(one: Path, other: Path) -> None:
    """Every bit but the clock: network, optimiser, statistics, generators, robots, curves."""
    a, b = checkpoint(one).tensors, checkpoint(other).tensors
    assert len(a) > 40
    assert_same(a, b)
    for name in ("progress.csv", "evaluations.csv"):
        assert curve(one / name) == curve(other / name)
    for name in ("policy.safetensors", "policy_best.safetensors"):
        assert (one / name).read_bytes() == (other / name).read_bytes()
