"""Speed of learning: PPO on walking robots, beside PPO on Gymnasium's Humanoid."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import cast

import gymnasium as gym
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import CallbackList
from stable_baselines3.common.vec_env import SubprocVecEnv, VecEnv

import fbid_gym
from eval.tools.bench.figures import Figure, FigureTable, Limit
from eval.tools.bench.timing import added, in_turns
from train.algorithms import ALGORITHMS
from train.learner import build
from train.learner import robots as robots_of
from train.recipes import config_for
from train.runs.config import TrainConfig

WORKERS = 8
LIMITS = {
    ("fbid_gym/QuadrupedWalk-v0", "joint_position"): Limit(7.5, at_least=True),
    ("fbid_gym/QuadrupedWalk-v0", "base_acceleration"): Limit(5.5, at_least=True),
    ("fbid_gym/BipedWalk-v0", "joint_position"): Limit(6.0, at_least=True),
    ("fbid_gym/BipedWalk-v0", "base_acceleration"): Limit(4.5, at_least=True),
}
"""Environment and layer -> frames per second relative to Humanoid-v5."""

OURS = "Humanoid-v5, our settings"
USUAL = "Humanoid-v5, stable-baselines3's settings"


def _humanoids() -> SubprocVecEnv:
    return SubprocVecEnv([partial(gym.make, "Humanoid-v5")] * WORKERS)


def frames(layers: list[str], rounds: int) -> FigureTable:
    """Frames per second of PPO by environment and layer, relative to Humanoid-v5.

    All learn as the recipe of the first environment has it: the same network, epochs, batches and
    frames an iteration; but for one more on Humanoid-v5, with the defaults of stable-baselines3.
    """
    first = config_for(next(iter(LIMITS))[0], "joint_position")
    assert first.ppo is not None
    theirs = replace(
        first,
        num_envs=WORKERS,
        torch_threads=first.learning_threads,
        ppo=replace(first.ppo, n_steps=first.iteration_steps // WORKERS),
    )
    measured = {key: limit for key, limit in LIMITS.items() if key[1] in layers}
    stretches = {OURS: _Learning(theirs, build(theirs, _humanoids()))}
    limits: dict[str, Limit] = {}
    for (env, layer), limit in measured.items():
        ours = config_for(env, layer)
        robots = fbid_gym.make_sb3(
            env, num_envs=ours.num_envs, seed=0, num_threads=ours.threads, **ours.make_args()
        )
        name = f"{env.rpartition('/')[2]}, `{layer}`"
        stretches[name], limits[name] = _Learning(ours, build(ours, robots)), limit
    usual = PPO("MlpPolicy", _humanoids(), device="cpu")
    sizes = {name: its.config.iteration_steps for name, its in stretches.items()}
    sizes[USUAL] = usual.n_steps * usual.n_envs
    try:
        # An iteration as stable-baselines3 goes on with it.
        more = partial(usual.learn, sizes[USUAL], reset_num_timesteps=False)
        work: dict[str, Callable[[], object]] = {**stretches, USUAL: more}
        timed = {n: added(lambda: None, its, 1, time.perf_counter) for n, its in work.items()}
        seconds = in_turns(timed, rounds)
    finally:
        for stretch in stretches.values():
            robots_of(stretch.learner).close()
        cast(VecEnv, usual.env).close()
    rates = {name: sizes[name] / values for name, values in seconds.items()}
    figures = [
        Figure.of(
            name, f"{np.median(values):,.0f} frames/s", values / rates[OURS], limits.get(name)
        )
        for name, values in rates.items()
    ]
    return FigureTable(
        "PPO",
        f"stable-baselines3 PPO, rollouts and updates, as the recipe has it with "
        f"{first.num_envs} robots, on {first.threads} threads, torch on {first.learning_threads} "
        f"while it learns; Humanoid-v5 in {WORKERS} "
        f"SubprocVecEnv workers with the same network, epochs, batches and "
        f"{first.iteration_steps} frames an iteration, and once more as stable-baselines3 sets it "
        "up. Figure: speed relative to Humanoid-v5 with our settings.",
        "x Humanoid-v5",
        tuple(figures),
    )


class _Learning:
    """Goes on with a training by an iteration, as `train.ppo` does."""

    def __init__(self, config: TrainConfig, learner: BaseAlgorithm) -> None:
        self.config, self.learner, self.callback = config, learner, CallbackList([])
        learner._setup_learn(config.total_steps, self.callback)

    def __call__(self) -> None:
        ALGORITHMS["ppo"].iterate(self.learner, self.config, self.callback)
