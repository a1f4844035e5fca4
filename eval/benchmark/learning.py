"""Speed of learning: PPO through each layer, beside PPO on Gymnasium's Humanoid."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import SubprocVecEnv

import fbid_gym
from eval.benchmark.environments import STEPS, PhysicsStretch
from eval.benchmark.figures import Figure, Limit, Section, interleave
from train.learner import build
from train.learner import robots as robots_of
from train.runs.config import TrainConfig

WORKERS = 8
ITERATIONS = 2
LIMITS = {
    "joint_position": Limit(4.5, at_least=True),
    "base_acceleration": Limit(2.5, at_least=True),
}


USUAL = "Humanoid-v5, stable-baselines3's settings"
PHYSICS = "biped, physics alone"


def _humanoid() -> gym.Env:
    return gym.make("Humanoid-v5")


def _humanoids() -> SubprocVecEnv:
    return SubprocVecEnv([_humanoid] * WORKERS)


def frames(layers: list[str], rounds: int) -> Section:
    """Frames per second of PPO by layer on the biped, relative to Humanoid-v5.

    Every learner collects as many frames per iteration and learns from them with the same network,
    batches and epochs; but for one more on Humanoid-v5, with the defaults of stable-baselines3.
    """
    config = TrainConfig()
    per_iteration = config.num_envs * config.ppo.n_steps
    theirs = replace(
        config,
        num_envs=WORKERS,
        ppo=replace(config.ppo, n_steps=per_iteration // WORKERS, batch_size=config.batch_size),
    )
    learners = {"Humanoid-v5": build(theirs, _humanoids())}
    for layer in layers:
        ours = replace(config, action_layer=layer)
        robots = fbid_gym.make_sb3(
            ours.env,
            num_envs=ours.num_envs,
            seed=0,
            num_threads=ours.threads,
            **ours.make_args(),
        )
        learners[layer] = build(ours, robots)
    humanoids = _humanoids()
    usual = PPO("MlpPolicy", humanoids, device="cpu")
    stretches: dict[str, _Learning | _Physics] = {
        name: _Learning(learner, ITERATIONS * per_iteration) for name, learner in learners.items()
    }
    stretches[USUAL] = _Learning(usual, WORKERS * usual.n_steps)
    stretches[PHYSICS] = physics = _Physics(config.num_envs, config.threads)
    try:
        seconds = interleave(dict(stretches), rounds, before={PHYSICS: physics.stretch.reset})
    finally:
        for learner in learners.values():
            robots_of(learner).close()
        humanoids.close()
    rates = {name: stretches[name].frames / values for name, values in seconds.items()}
    figures = [
        Figure.of(
            f"biped, `{name}`" if name in layers else name,
            f"{np.median(values):,.0f} frames/s",
            values / rates["Humanoid-v5"],
            LIMITS.get(name),
        )
        for name, values in rates.items()
    ]
    return Section(
        "PPO",
        f"stable-baselines3 PPO, rollouts and updates, as `train.ppo` sets it up with "
        f"{config.num_envs} robots, on {config.threads} threads; Humanoid-v5 in {WORKERS} "
        f"SubprocVecEnv workers with the same network, epochs, batches and "
        f"{per_iteration} frames an iteration, and once more as stable-baselines3 sets it up. "
        "Figure: speed relative to Humanoid-v5 with our settings. The last row is what no learner "
        "on the biped can pass: its physics on as many threads, standing, without layer, "
        "observation, policy and updates.",
        "x Humanoid-v5",
        tuple(figures),
    )


class _Learning:
    """Learns for some more frames."""

    def __init__(self, learner: PPO, frames: int) -> None:
        self.learner, self.frames = learner, frames

    def __call__(self) -> None:
        self.learner.learn(self.frames, reset_num_timesteps=False)


class _Physics:
    """Steps the physics of some frames and does nothing else."""

    def __init__(self, num_envs: int, num_threads: int) -> None:
        self.stretch = PhysicsStretch("biped", num_envs, num_threads)
        self.frames = STEPS * num_envs

    def __call__(self) -> None:
        self.stretch()
