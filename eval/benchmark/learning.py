"""Speed of learning: PPO on walking robots, beside PPO on Gymnasium's Humanoid."""

from dataclasses import replace
from typing import cast

import gymnasium as gym
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import SubprocVecEnv

import fbid_gym
from eval.benchmark.figures import Figure, Limit, Section, interleave
from train.learner import build
from train.learner import robots as robots_of
from train.recipes import config_for

WORKERS = 8
LIMITS = {
    ("fbid_gym/QuadrupedWalk-v0", "joint_position"): Limit(7.0, at_least=True),
    ("fbid_gym/QuadrupedWalk-v0", "base_acceleration"): Limit(5.0, at_least=True),
    ("fbid_gym/BipedWalk-v0", "joint_position"): Limit(5.0, at_least=True),
    ("fbid_gym/BipedWalk-v0", "base_acceleration"): Limit(3.5, at_least=True),
}
"""Environment and layer -> frames per second relative to Humanoid-v5."""

OURS = "Humanoid-v5, our settings"
USUAL = "Humanoid-v5, stable-baselines3's settings"


def _humanoid() -> gym.Env:
    return gym.make("Humanoid-v5")


def _humanoids() -> SubprocVecEnv:
    return SubprocVecEnv([_humanoid] * WORKERS)


def frames(layers: list[str], rounds: int) -> Section:
    """Frames per second of PPO by environment and layer, relative to Humanoid-v5.

    All learn as the recipe of the first environment has it: the same network, epochs, batches and
    frames an iteration; but for one more on Humanoid-v5, with the defaults of stable-baselines3.
    """
    first = config_for(next(iter(LIMITS))[0], "joint_position")
    assert first.ppo is not None
    theirs = replace(
        first,
        num_envs=WORKERS,
        ppo=replace(first.ppo, n_steps=first.iteration_steps // WORKERS),
    )
    measured = {key: limit for key, limit in LIMITS.items() if key[1] in layers}
    learners = {OURS: cast(PPO, build(theirs, _humanoids()))}
    limits: dict[str, Limit] = {}
    for (env, layer), limit in measured.items():
        ours = config_for(env, layer)
        robots = fbid_gym.make_sb3(
            env, num_envs=ours.num_envs, seed=0, num_threads=ours.threads, **ours.make_args()
        )
        name = f"{env.rpartition('/')[2]}, `{layer}`"
        learners[name], limits[name] = cast(PPO, build(ours, robots)), limit
    humanoids = _humanoids()
    usual = PPO("MlpPolicy", humanoids, device="cpu")
    stretches = {name: _Learning(its, its.n_steps * its.n_envs) for name, its in learners.items()}
    stretches[USUAL] = _Learning(usual, usual.n_steps * usual.n_envs)
    try:
        seconds = interleave(dict(stretches), rounds)
    finally:
        for learner in learners.values():
            robots_of(learner).close()
        humanoids.close()
    rates = {name: stretches[name].frames / values for name, values in seconds.items()}
    figures = [
        Figure.of(
            name, f"{np.median(values):,.0f} frames/s", values / rates[OURS], limits.get(name)
        )
        for name, values in rates.items()
    ]
    return Section(
        "PPO",
        f"stable-baselines3 PPO, rollouts and updates, as the recipe has it with "
        f"{first.num_envs} robots, on {first.threads} threads; Humanoid-v5 in {WORKERS} "
        f"SubprocVecEnv workers with the same network, epochs, batches and "
        f"{first.iteration_steps} frames an iteration, and once more as stable-baselines3 sets it "
        "up. Figure: speed relative to Humanoid-v5 with our settings.",
        "x Humanoid-v5",
        tuple(figures),
    )


class _Learning:
    """Learns for some more frames."""

    def __init__(self, learner: PPO, frames: int) -> None:
        self.learner, self.frames = learner, frames

    def __call__(self) -> None:
        self.learner.learn(self.frames, reset_num_timesteps=False)
